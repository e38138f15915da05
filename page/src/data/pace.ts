/** How fast time should pass where a run is dull, and where it is lively. */

import type { EventKind } from "../contract";
import type { Run } from "./run";

const CELL_US = 10e6;
/** Times real time at which a stretch is watched, by what happens in it: nothing, robots move, people move, they meet. */
const SPEEDS = [12_000, 600, 80, 20] as const;
type Level = 0 | 1 | 2 | 3;
const MEETS: readonly EventKind[] = ["asks", "accepted", "declined", "deferred", "found"];
/** Stretches of this length around a meeting are watched at ease. */
const AROUND_US = 20e6;
const MORNING = [6, 11] as const;
const GLANCE_US = 20 * 60e6;

/** How lively each ten seconds of a run are. */
export class Pace {
  private readonly levels: Uint8Array;

  constructor(private readonly run: Run) {
    this.levels = new Uint8Array(Math.max(1, Math.ceil(run.presentUs / CELL_US)));
    for (const body of run.bodies) {
      const level = body.robot ? 1 : 2;
      for (const [from, to] of run.tracks.get(body.name)?.moves() ?? []) this.raise(from, to, level);
    }
    for (const kind of MEETS) {
      for (const { us } of run.events.ofKind(kind)) this.raise(us - AROUND_US, us + AROUND_US, 3);
    }
  }

  private raise(from: number, to: number, level: Level): void {
    const last = Math.min(this.levels.length - 1, Math.floor(to / CELL_US));
    for (let i = Math.max(0, Math.floor(from / CELL_US)); i <= last; i++) {
      if (this.levels[i]! < level) this.levels[i] = level;
    }
  }

  /** How fast time passes at a moment. */
  speedAt(us: number): number {
    return SPEEDS[this.levels[Math.min(this.levels.length - 1, Math.floor(us / CELL_US))] as Level];
  }

  /** The moment that is shown some seconds after another one: dull time flies, and no lively stretch is jumped over. */
  after(us: number, seconds: number): number {
    let [at, left] = [us, seconds * 1e6];
    while (left > 0 && at < this.run.presentUs) {
      const speed = this.speedAt(at);
      const end = (Math.floor(at / CELL_US) + 1) * CELL_US;
      const needs = (end - at) / speed;
      if (needs > left) return at + left * speed;
      left -= needs;
      at = end;
    }
    return at;
  }

  /** The share of moments between two at which people move, 0 to 1. */
  busy(from: number, to: number): number {
    const [first, last] = [Math.max(0, Math.floor(from / CELL_US)), Math.min(this.levels.length, Math.ceil(to / CELL_US))];
    let moving = 0;
    for (let i = first; i < last; i++) if (this.levels[i]! >= 2) moving++;
    return moving / Math.max(1, last - first);
  }

  private known: { key: string; shares: number[] } = { key: "", shares: [] };

  /** The share of moments at which people move, in each cell between two moments. */
  shares(begin: number, end: number, cell: number): readonly number[] {
    const key = `${begin} ${end} ${cell}`;
    if (key !== this.known.key) {
      const count = Math.ceil((end - begin) / cell);
      const shares = Array.from({ length: count }, (_, i) => this.busy(begin + i * cell, begin + (i + 1) * cell));
      this.known = { key, shares };
    }
    return this.known.shares;
  }

  /** The liveliest morning of the run: its first moment; without any, the begin of the run. */
  liveliest(): number {
    const { clock, beginUs, presentUs } = this.run;
    let [best, most] = [beginUs, 0];
    for (let day = clock.day(beginUs); day <= clock.day(presentUs - 1); day++) {
      const midnight = clock.dayStart(day);
      for (let us = midnight + MORNING[0] * 3600e6; us < midnight + MORNING[1] * 3600e6; us += GLANCE_US / 2) {
        const share = us >= beginUs && us + GLANCE_US <= presentUs ? this.busy(us, us + GLANCE_US) : 0;
        if (share > most) [best, most] = [us, share];
      }
    }
    return best;
  }
}

const paces = new WeakMap<Run, { pace: Pace; read: string }>();

/** The pace of a run, as far as it is read. */
export function paceOf(run: Run): Pace {
  const read = `${run.tracks.size} ${run.events.rows.length}`;
  let known = paces.get(run);
  if (known?.read !== read) paces.set(run, (known = { pace: new Pace(run), read }));
  return known.pace;
}
