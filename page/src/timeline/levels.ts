/** Stretches at several levels of detail, so that a year is drawn as quickly as an hour. */

import type { Stretches } from "../data/stretches";

/** Lanes of fewer stretches are drawn as they are. */
const FEW = 2000;
const SECOND_US = 1e6;

/** Levels that were computed, until the stretches of a live run have grown. */
const levels = new WeakMap<Stretches, { endUs: number; merged: Map<number, Stretches> }>();

/**
 * The stretches for a scale: what is shorter than a pixel is merged, into what fills most of that time, or into what
 * has the highest rank, so that a short violation isn't lost. Each level is computed once.
 */
export function levelOf(stretches: Stretches, pixelUs: number, rank?: (value: number) => number): Stretches {
  const level = Math.floor(Math.log2(pixelUs / SECOND_US));
  if (level < 1 || stretches.from.length < FEW) return stretches;
  const endUs = stretches.to[stretches.to.length - 1]!;
  let computed = levels.get(stretches);
  if (computed?.endUs !== endUs) levels.set(stretches, (computed = { endUs, merged: new Map() }));
  let merged = computed.merged.get(level);
  if (!merged) computed.merged.set(level, (merged = mergedStretches(stretches, SECOND_US * 2 ** level, rank)));
  return merged;
}

/** Stretches on a grid of a width: each cell has one value. */
export function mergedStretches(stretches: Stretches, width: number, rank?: (value: number) => number): Stretches {
  const [from, to, value]: [number[], number[], number[]] = [[], [], []];
  const push = (begin: number, end: number, what: number): void => {
    const n = from.length - 1;
    if (n >= 0 && to[n] === begin && value[n] === what) to[n] = end;
    else {
      from.push(begin);
      to.push(end);
      value.push(what);
    }
  };
  let cell = -1;
  const time = new Map<number, number>();
  const flush = (): void => {
    let [best, most] = [0, -Infinity];
    for (const [what, lasts] of time) {
      const weight = rank ? rank(what) : lasts;
      if (weight > most) [best, most] = [what, weight];
    }
    if (time.size > 0) push(cell * width, (cell + 1) * width, best);
    time.clear();
  };
  const add = (at: number, what: number, lasts: number): void => {
    if (at !== cell) {
      flush();
      cell = at;
    }
    time.set(what, (time.get(what) ?? 0) + lasts);
  };
  for (let i = 0; i < stretches.from.length; i++) {
    const [begin, end, what] = [stretches.from[i]!, stretches.to[i]!, stretches.value[i]!];
    const first = Math.floor(begin / width);
    const last = Math.max(first, Math.ceil(end / width) - 1);
    add(first, what, Math.min(end, (first + 1) * width) - begin);
    if (last === first) continue;
    if (last > first + 1) {
      flush();
      push((first + 1) * width, last * width, what);
    }
    add(last, what, end - last * width);
  }
  flush();
  return { from, to, value };
}
