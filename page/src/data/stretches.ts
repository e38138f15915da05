/** Lanes of a timeline: stretches of time, each with one value. */

import { firstAtLeast, lastAtMost } from "./search";

/** Stretches in order: each begins at `from[i]` [us] and ends at `to[i]`. */
export interface Stretches {
  from: Float64Array | number[];
  to: Float64Array | number[];
  value: Int32Array | number[];
}

export function valueAt(stretches: Stretches, us: number): number | null {
  const i = lastAtMost(stretches.from, us);
  return i >= 0 && us < stretches.to[i]! ? stretches.value[i]! : null;
}

/** Stretches of a value that changes at moments and holds until the next change. */
export function stretchesOf(moments: readonly number[], values: readonly number[], endUs: number): Stretches {
  const from: number[] = [];
  const value: number[] = [];
  moments.forEach((moment, i) => {
    if (from.length > 0 && value[value.length - 1] === values[i]) return;
    if (from.length > 0 && from[from.length - 1] === moment) {
      value[value.length - 1] = values[i]!;
      return;
    }
    from.push(moment);
    value.push(values[i]!);
  });
  const to = from.map((_, i) => from[i + 1] ?? endUs);
  return { from, to, value };
}

/** The stretches before a moment, as lists that can grow. */
export function stretchesUntil({ from, to, value }: Stretches, us: number): Stretches {
  const count = firstAtLeast(from, us);
  const ends = Array.from(to.slice(0, count), (end) => Math.min(end, us));
  return { from: Array.from(from.slice(0, count)), to: ends, value: Array.from(value.slice(0, count)) };
}

/** The stretches in which two lanes have different values; the value is 1. */
export function differences(a: Stretches, b: Stretches): Stretches {
  const cuts = [...new Set([...a.from, ...a.to, ...b.from, ...b.to])].sort((one, other) => one - other);
  const result: Stretches = { from: [], to: [], value: [] };
  const [from, to, value] = [result.from as number[], result.to as number[], result.value as number[]];
  for (let i = 0; i + 1 < cuts.length; i++) {
    const middle = (cuts[i]! + cuts[i + 1]!) / 2;
    const [one, other] = [valueAt(a, middle), valueAt(b, middle)];
    if (one === null || other === null || one === other) continue;
    if (to.length > 0 && to[to.length - 1] === cuts[i]) to[to.length - 1] = cuts[i + 1]!;
    else {
      from.push(cuts[i]!);
      to.push(cuts[i + 1]!);
      value.push(1);
    }
  }
  return result;
}

/** Time [us] that each value holds up to a moment; values below 0 count at the end. */
export function timeByValue(stretches: Stretches, values: number, untilUs: number): Float64Array {
  const time = new Float64Array(values + 1);
  for (let i = 0; i < stretches.from.length; i++) {
    const from = stretches.from[i]!;
    if (from >= untilUs) break;
    const value = stretches.value[i]!;
    time[value >= 0 ? value : values]! += Math.min(untilUs, stretches.to[i]!) - from;
  }
  return time;
}

/** Time [us] between two moments by the word for each value. */
export function timeByWord(stretches: Stretches, word: (value: number) => string, fromUs: number, toUs: number): Map<string, number> {
  const time = new Map<string, number>();
  for (let i = firstAtLeast(stretches.to, fromUs); i < stretches.from.length && stretches.from[i]! < toUs; i++) {
    const lasts = Math.min(toUs, stretches.to[i]!) - Math.max(fromUs, stretches.from[i]!);
    const name = word(stretches.value[i]!);
    if (lasts > 0) time.set(name, (time.get(name) ?? 0) + lasts);
  }
  return time;
}
