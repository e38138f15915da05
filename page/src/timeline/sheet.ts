/** Where the days of a calendar are on its sheet: a row a day, hours from left to right. */

import type { Clock } from "../data/clock";

/** Pixels above the rows for the hours, left of them for the dates, and right of them for the time in view. */
export const HEAD = 22;
export const LEFT = 96;
export const RIGHT = 118;
const FOOT = 4;
const NARROW_RIGHT = 8;
const NARROW = 700;
/** Pixels between two rows. */
export const GAP = 2;
/** Heights of a row [px]. */
const LEAST_ROW = 10;
const MOST_ROW = 24;
/** A row of many people is taller where there is room: it has a strip for each. */
const MOST_ROW_OF_STRIP = 6;

export interface Days {
  first: number;
  count: number;
}

function mostRow(strips: number): number {
  return Math.max(MOST_ROW, strips * MOST_ROW_OF_STRIP);
}

/** The height that the rows of some days take where there is room. */
export function roomyHeight(days: number, strips: number): number {
  return HEAD + days * mostRow(strips) + FOOT;
}

export class Sheet {
  readonly rowHeight: number;

  constructor(
    readonly width: number,
    readonly height: number,
    readonly scrolled: number,
    readonly days: Days,
    strips: number,
    /** Whether robots may have had people in view. */
    private readonly tellsView: boolean,
    private readonly clock: Clock,
  ) {
    // All days are seen at once where they fit; else one scrolls.
    const fitting = Math.floor((height - HEAD - FOOT) / days.count);
    this.rowHeight = Math.max(LEAST_ROW, Math.min(mostRow(strips), fitting));
  }

  get hasTotals(): boolean {
    return this.tellsView && this.width >= NARROW;
  }

  /** The width of a day. */
  get wide(): number {
    return this.width - LEFT - (this.hasTotals ? RIGHT : NARROW_RIGHT);
  }

  /** The height of what a row shows. */
  get tall(): number {
    return this.rowHeight - GAP;
  }

  /** The height of all rows. */
  get whole(): number {
    return HEAD + this.days.count * this.rowHeight + FOOT;
  }

  top(day: number): number {
    return HEAD + (day - this.days.first) * this.rowHeight - this.scrolled;
  }

  /** The place of a moment in the row of a day; moments of other days are at its ends. */
  x(us: number, day: number): number {
    const share = us < this.clock.dayStart(day + 1) ? this.clock.share(us, day) : 1;
    return LEFT + Math.max(0, Math.min(1, share)) * this.wide;
  }

  /** The days whose rows are seen. */
  get visible(): number[] {
    const from = Math.max(0, Math.floor(this.scrolled / this.rowHeight));
    const to = Math.min(this.days.count, from + Math.ceil(this.height / this.rowHeight) + 1);
    return Array.from({ length: Math.max(0, to - from) }, (_, i) => this.days.first + from + i);
  }

  /** The day and the moment at a place, and how far down in the row it is, from 0 to 1. */
  at(x: number, y: number): { us: number; day: number; down: number } | null {
    const row = Math.floor((y - HEAD + this.scrolled) / this.rowHeight);
    if (y < HEAD || row < 0 || row >= this.days.count) return null;
    const day = this.days.first + row;
    const share = Math.max(0, Math.min(0.99999, (x - LEFT) / this.wide));
    const down = Math.max(0, Math.min(0.9999, (y - this.top(day)) / this.tall));
    return { us: this.clock.ofShare(share, day), day, down };
  }
}
