/** What many people do at once: how many of them do each kind of thing, in cells of five minutes. */

import { type Clock, DAY_US } from "../data/clock";
import { valueAt } from "../data/stretches";
import type { Strip } from "./days";
import type { Days } from "./sheet";

export const CELLS_A_DAY = 288;
const CELL_US = DAY_US / CELLS_A_DAY;

export class Crowd {
  /** Words and colours of kinds; the first one is drawn at the top. */
  readonly kinds: readonly (readonly [string, string])[];
  readonly people: number;
  private readonly counts: Uint16Array;

  constructor(
    private readonly strips: readonly Strip[],
    private readonly clock: Clock,
    private readonly days: Days,
  ) {
    this.people = strips.length;
    this.kinds = [...new Map(strips.flatMap((strip) => strip.legend))];
    this.counts = new Uint16Array(days.count * CELLS_A_DAY * this.kinds.length);
    for (const strip of strips) this.count(strip);
  }

  /** Count what a person does in the middle of each cell. */
  private count({ stretches: { from, to, value }, color }: Strip): void {
    const begin = this.clock.dayStart(this.days.first);
    const kindOfColor = new Map(this.kinds.map(([, color], kind) => [color, kind]));
    const cells = this.days.count * CELLS_A_DAY;
    for (let i = 0; i < from.length; i++) {
      const kind = kindOfColor.get(color(value[i]!))!;
      const last = Math.min(cells, Math.ceil((to[i]! - begin) / CELL_US - 0.5));
      for (let cell = Math.max(0, Math.ceil((from[i]! - begin) / CELL_US - 0.5)); cell < last; cell++) {
        this.counts[cell * this.kinds.length + kind]!++;
      }
    }
  }

  /** How many do each kind of thing in a cell of a day. */
  countsAt(day: number, cell: number): Uint16Array {
    const at = ((day - this.days.first) * CELLS_A_DAY + cell) * this.kinds.length;
    return this.counts.subarray(at, at + this.kinds.length);
  }

  /** How many do what at a moment, in words. */
  words(us: number): string {
    const counts = new Map<string, number>();
    const wordsOfColor = new Map(this.kinds.map(([words, color]) => [color, words]));
    for (const strip of this.strips) {
      const value = valueAt(strip.stretches, us);
      if (value === null) continue;
      const words = wordsOfColor.get(strip.color(value))!;
      counts.set(words, (counts.get(words) ?? 0) + 1);
    }
    const ordered = [...counts].sort(([, one], [, other]) => other - one);
    return ordered.map(([words, count]) => `${words} ${count}`).join(", ");
  }
}
