/**
 * Poses at any moment, from key frames: the arithmetic of `fleet2d.runs.trajectory` and of the kernel
 * `trace_track`, in lattice units and 1/4096 of a turn, so that a pose at a step is the run's own.
 */

import type { Table, Words } from "./parquet";
import { lastAtMost } from "./search";

export const TURN = 4096;

export interface Pose {
  x: number;
  y: number;
  heading: number;
  away: boolean;
}

/** The shorter signed turn from one heading to another, in [-2048, 2047]. */
export function turnBetween(start: number, end: number): number {
  return ((end - start + TURN / 2) & (TURN - 1)) - TURN / 2;
}

function interpolate(start: number, change: number, elapsed: number, duration: number): number {
  return start + Math.floor((2 * change * elapsed + duration) / (2 * duration));
}

/** Key frames of one body; arrays grow as a live run goes on. */
export class Track {
  /** Pieces: key frames from `begins[i]` to `ends[i]`, which hold from `froms[i]` [us] on. */
  private readonly begins: number[] = [];
  private readonly ends: number[] = [];
  readonly froms: number[] = [];

  constructor(
    public time: Float64Array,
    public x: Int32Array,
    public y: Int32Array,
    public heading: Int16Array,
    public away: Uint8Array,
    planned: Uint8Array,
    fromUs: (row: number) => number,
    public count: number = time.length,
  ) {
    let begin = 0;
    while (begin < count) {
      let end = begin + 1;
      while (end < count && !planned[end]) end++;
      if (end < count) end++; // an end that was never reached
      this.begins.push(begin);
      this.ends.push(end);
      this.froms.push(fromUs(begin));
      begin = end;
    }
  }

  get empty(): boolean {
    return this.count === 0;
  }

  /** Index of the last key frame that holds at a moment, and of the end of its piece. */
  private find(us: number): [number, number] {
    const piece = Math.max(0, lastAtMost(this.froms, us));
    const begin = this.begins[piece]!;
    const end = this.ends[piece]!;
    return [Math.max(begin, lastAtMost(this.time, us, begin, end)), end];
  }

  poseAt(us: number): Pose {
    const [i, end] = this.find(us);
    let x = this.x[i]!;
    let y = this.y[i]!;
    let heading = this.heading[i]!;
    if (this.time[i]! <= us && i < end - 1) {
      const elapsed = us - this.time[i]!;
      const duration = this.time[i + 1]! - this.time[i]!;
      const turn = turnBetween(heading, this.heading[i + 1]!);
      x = interpolate(x, this.x[i + 1]! - x, elapsed, duration);
      y = interpolate(y, this.y[i + 1]! - y, elapsed, duration);
      heading = interpolate(heading, turn, elapsed, duration) & (TURN - 1);
    }
    return { x, y, heading, away: this.away[i] === 1 };
  }

  /** Whether the body is at another place at a key frame between two moments than at the first. */
  movesWithin(fromUs: number, toUs: number): boolean {
    const corners = this.way(fromUs, toUs);
    for (let i = 2; i < corners.length; i++) if (corners[i] !== corners[i - 2]) return true;
    return false;
  }

  /** Corners of the way between two moments, x and y in turn, without stretches away. */
  way(fromUs: number, toUs: number): number[] {
    const corners: number[] = [];
    if (this.empty) return corners;
    const push = (pose: Pose): void => {
      if (!pose.away) corners.push(pose.x, pose.y);
    };
    push(this.poseAt(fromUs));
    for (const us of this.breaksBetween(fromUs, toUs)) push(this.poseAt(us));
    push(this.poseAt(toUs));
    return corners;
  }

  /** Moments between two at which a key frame was reached or a piece begins. */
  private *breaksBetween(fromUs: number, toUs: number): Generator<number> {
    let piece = Math.max(0, lastAtMost(this.froms, fromUs));
    for (; piece < this.begins.length; piece++) {
      const until = this.froms[piece + 1] ?? Infinity;
      if (this.froms[piece]! > fromUs && this.froms[piece]! < toUs) yield this.froms[piece]!;
      const end = this.ends[piece]!;
      let i = lastAtMost(this.time, fromUs, this.begins[piece]!, end) + 1;
      for (i = Math.max(i, this.begins[piece]!); i < end; i++) {
        if (this.time[i]! >= Math.min(until, toUs)) break;
        yield this.time[i]!;
      }
      if (until >= toUs) return;
    }
  }

  /**
   * Stretches of time in which the body may have moved: pairs of moments [us], in order. Between
   * them it stands still.
   */
  *moves(): Generator<[number, number]> {
    for (let piece = 0; piece < this.begins.length; piece++) {
      const until = this.froms[piece + 1] ?? Infinity;
      for (let i = this.begins[piece]!; i < this.ends[piece]! - 1; i++) {
        const stays = this.x[i] === this.x[i + 1] && this.y[i] === this.y[i + 1];
        const from = Math.max(this.time[i]!, this.froms[piece]!);
        const to = Math.min(this.time[i + 1]!, until);
        if (!stays && to > from) yield [from, to];
      }
    }
  }

  /**
   * Stretches of time in which the place of the body may change, in order: moments at which it begins to stand
   * somewhere, or to be away, and the time between two of them if it moves.
   */
  *changes(): Generator<readonly [number, number]> {
    for (let piece = 0; piece < this.begins.length; piece++) {
      const [from, until, end] = [this.froms[piece]!, this.froms[piece + 1] ?? Infinity, this.ends[piece]!];
      yield [from, from];
      for (let i = this.begins[piece]!; i < end && this.time[i]! < until; i++) {
        const next = i + 1;
        const moves = next < end && (this.x[i] !== this.x[next] || this.y[i] !== this.y[next]);
        const since = Math.max(this.time[i]!, from);
        const to = moves ? Math.min(this.time[next]!, until) : since;
        if (to >= since) yield [since, to];
      }
    }
  }

  /** Tell where the body is at each of some steps, which are in order. */
  follow(steps: readonly number[], stepUs: number, tell: (step: number, x: number, y: number, away: boolean) => void): void {
    let [piece, i] = [0, this.begins[0]!];
    for (const step of steps) {
      const us = step * stepUs;
      while (piece + 1 < this.froms.length && this.froms[piece + 1]! <= us) i = this.begins[++piece]!;
      const end = this.ends[piece]!;
      while (i + 1 < end && this.time[i + 1]! <= us) i++;
      let [x, y] = [this.x[i]!, this.y[i]!];
      if (this.time[i]! <= us && i + 1 < end) {
        const elapsed = us - this.time[i]!;
        const duration = this.time[i + 1]! - this.time[i]!;
        x = interpolate(x, this.x[i + 1]! - x, elapsed, duration);
        y = interpolate(y, this.y[i + 1]! - y, elapsed, duration);
      }
      tell(step, x, y, this.away[i] === 1);
    }
  }

  /** Add a pose of a live run; between two of them the body moves in a straight line. */
  append(us: number, pose: Pose): void {
    if (this.count === this.time.length) this.grow();
    const i = this.count++;
    this.time[i] = us;
    this.x[i] = pose.x;
    this.y[i] = pose.y;
    this.heading[i] = pose.heading;
    this.away[i] = pose.away ? 1 : 0;
    if (i === 0) {
      this.begins.push(0);
      this.froms.push(us);
      this.ends.push(1);
    } else {
      this.ends[this.ends.length - 1] = this.count;
    }
  }

  /** A copy up to a moment, to which poses can be added. */
  until(us: number): Track {
    const track = Track.none();
    if (this.empty) return track;
    const piece = Math.max(0, lastAtMost(this.froms, us));
    const begin = this.begins[piece]!;
    track.count = Math.max(begin, lastAtMost(this.time, us, begin, this.ends[piece]!)) + 1;
    for (const name of ["time", "x", "y", "heading", "away"] as const) (track[name] as Float64Array) = this[name].slice(0, track.count) as Float64Array;
    track.begins.push(...this.begins.slice(0, piece + 1));
    track.ends.push(...this.ends.slice(0, piece), track.count);
    track.froms.push(...this.froms.slice(0, piece + 1));
    track.append(us, this.poseAt(us));
    return track;
  }

  private grow(): void {
    const size = Math.max(1024, 2 * this.time.length);
    const larger = <T extends { set(values: T): void }>(values: T, made: T): T => {
      made.set(values);
      return made;
    };
    this.time = larger(this.time, new Float64Array(size));
    this.x = larger(this.x, new Int32Array(size));
    this.y = larger(this.y, new Int32Array(size));
    this.heading = larger(this.heading, new Int16Array(size));
    this.away = larger(this.away, new Uint8Array(size));
  }

  static none(): Track {
    const none = new Float64Array(0);
    return new Track(none, new Int32Array(0), new Int32Array(0), new Int16Array(0), new Uint8Array(0), new Uint8Array(0), () => 0);
  }
}

/** The tracks of bodies from the arrays that a server sends: see `PageData.tracks`. */
export function tracksOf(content: ArrayBuffer, bodies: readonly string[], stepUs: number): Map<string, Track> {
  const counts = new Float64Array(content, 0, bodies.length);
  const total = counts.reduce((sum, count) => sum + count, 0);
  let offset = counts.byteLength;
  const next = <T>(kind: { new (buffer: ArrayBuffer, offset: number, length: number): T; BYTES_PER_ELEMENT: number }): T => {
    const values = new kind(content, offset, total);
    offset += total * kind.BYTES_PER_ELEMENT;
    return values;
  };
  const time = next(Float64Array);
  const [x, y, step] = [next(Int32Array), next(Int32Array), next(Int32Array)];
  const heading = next(Int16Array);
  const [away, planned] = [next(Uint8Array), next(Uint8Array)];
  let from = 0;
  const tracks = bodies.map((name, i) => {
    const [begin, end] = [from, (from += counts[i]!)];
    const part = <T extends { subarray(begin: number, end: number): T }>(values: T): T => values.subarray(begin, end);
    const fromUs = (row: number): number => step[begin + row]! * stepUs;
    return [name, new Track(part(time), part(x), part(y), part(heading), part(away), part(planned), fromUs)] as const;
  });
  return new Map(tracks);
}

export interface TrackScale {
  unitsPerM: number;
  originUnits: readonly [number, number];
  startMs: number;
  stepUs: number;
}

/** Read the tracks of all bodies of a run. */
export async function readTracks(
  table: Table,
  names: readonly string[],
  scale: TrackScale,
): Promise<Map<string, Track>> {
  const [step, time, x, y, heading, away] = await Promise.all(
    ["step", "time", "x", "y", "heading", "away"].map((name) => table.numbers(name)),
  );
  const [entity, kind] = await Promise.all([table.words("entity"), table.words("kind")]);
  const rows = rowsByWord(entity);
  const planned = kind.words.indexOf("planned");
  const tracks = new Map<string, Track>();
  for (const name of names) {
    const rowsOfBody = rows.get(name) ?? new Int32Array(0);
    const pick = <T>(make: (length: number) => T & { [index: number]: number }, of: (row: number) => number): T => {
      const values = make(rowsOfBody.length);
      for (let i = 0; i < rowsOfBody.length; i++) values[i] = of(rowsOfBody[i]!);
      return values;
    };
    const [originX, originY] = scale.originUnits;
    const { unitsPerM, startMs, stepUs } = scale;
    tracks.set(
      name,
      new Track(
        pick((n) => new Float64Array(n), (row) => time![row]! - startMs * 1000),
        pick((n) => new Int32Array(n), (row) => Math.round(x![row]! * unitsPerM) - originX),
        pick((n) => new Int32Array(n), (row) => Math.round(y![row]! * unitsPerM) - originY),
        pick((n) => new Int16Array(n), (row) => Math.round((heading![row]! * TURN) / (2 * Math.PI)) & (TURN - 1)),
        pick((n) => new Uint8Array(n), (row) => away![row]!),
        pick((n) => new Uint8Array(n), (row) => (kind.codes[row] === planned ? 1 : 0)),
        (row) => step![rowsOfBody[row]!]! * stepUs,
      ),
    );
  }
  return tracks;
}

function rowsByWord(column: Words): Map<string, Int32Array> {
  const counts = new Int32Array(column.words.length);
  for (const code of column.codes) if (code >= 0) counts[code]!++;
  const rows = column.words.map((_, code) => new Int32Array(counts[code]!));
  counts.fill(0);
  column.codes.forEach((code, row) => {
    if (code >= 0) rows[code]![counts[code]!++] = row;
  });
  return new Map(column.words.map((word, code) => [word, rows[code]!]));
}
