/** Binary search in sorted arrays. */

/** The last index whose value is at most `value`; -1 where there is none. */
export function lastAtMost(values: ArrayLike<number>, value: number, from = 0, to = values.length): number {
  let low = from - 1;
  let high = to;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (values[middle]! <= value) low = middle;
    else high = middle;
  }
  return low >= from ? low : -1;
}

/** The first index whose value is at least `value`; the length where there is none. */
export function firstAtLeast(values: ArrayLike<number>, value: number): number {
  let low = -1;
  let high = values.length;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (values[middle]! < value) low = middle;
    else high = middle;
  }
  return high;
}
