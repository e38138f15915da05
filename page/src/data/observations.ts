/** What robots noticed at a step, read from the part of the table that holds it. */

import type { Table, Words } from "./parquet";
import { firstAtLeast, lastAtMost } from "./search";

export interface Observation {
  robot: string;
  user: string;
  x: number;
  y: number;
  room: string;
  trueUser: string | null;
  trueX: number;
  trueY: number;
}

interface Part {
  step: Float64Array;
  x: Float64Array;
  y: Float64Array;
  robot: Words;
  user: Words;
  room: Words;
  trueUser: Words | null;
  trueX: Float64Array | null;
  trueY: Float64Array | null;
}

const MOST_PARTS = 4;

/** Where observations come from: a table, or a running simulation. */
export interface ObservationSource {
  /** Observations at a step; null while they aren't read yet. */
  at(step: number): Observation[] | null;
  load(step: number): Promise<void>;
}

export class Observations implements ObservationSource {
  private readonly parts = new Map<number, Promise<Part>>();
  private readonly ready = new Map<number, Part>();
  private readonly starts: number[];
  private readonly minima: number[];

  constructor(private readonly table: Table) {
    this.starts = table.groupStarts;
    this.minima = table.groupMinima("step").map((least) => least ?? 0);
  }

  /** Observations at a step; null while the part of the table that holds it isn't read yet. */
  at(step: number): Observation[] | null {
    const groups = this.groupsOf(step);
    const rows: Observation[] = [];
    for (const group of groups) {
      const part = this.ready.get(group);
      if (!part) return null;
      for (let i = firstAtLeast(part.step, step); i < part.step.length && part.step[i] === step; i++) {
        rows.push(observation(part, i));
      }
    }
    return rows;
  }

  /** Read the part of the table that holds a step. */
  async load(step: number): Promise<void> {
    await Promise.all(this.groupsOf(step).map((group) => this.part(group)));
  }

  /** A step may end one row group and begin the next. */
  private groupsOf(step: number): number[] {
    const last = lastAtMost(this.minima, step);
    if (last < 0) return [];
    return last > 0 && this.minima[last] === step ? [last - 1, last] : [last];
  }

  private part(group: number): Promise<Part> {
    let part = this.parts.get(group);
    if (!part) {
      part = this.read(group).then((content) => {
        this.ready.set(group, content);
        return content;
      });
      this.parts.set(group, part);
      if (this.parts.size > MOST_PARTS) {
        const oldest = this.parts.keys().next().value!;
        this.parts.delete(oldest);
        this.ready.delete(oldest);
      }
    }
    return part;
  }

  private async read(group: number): Promise<Part> {
    const from = this.starts[group]!;
    const to = this.starts[group + 1]!;
    const numbers = (name: string): Promise<Float64Array> => this.table.numbers(name, from, to);
    const words = (name: string): Promise<Words> => this.table.words(name, from, to);
    const erring = this.table.has("true_user");
    return {
      step: await numbers("step"),
      x: await numbers("x"),
      y: await numbers("y"),
      robot: await words("robot"),
      user: await words("user"),
      room: await words("room"),
      trueUser: erring ? await words("true_user") : null,
      trueX: erring ? await numbers("true_x") : null,
      trueY: erring ? await numbers("true_y") : null,
    };
  }
}

function observation(part: Part, i: number): Observation {
  const word = (column: Words): string => column.words[column.codes[i]!] ?? "";
  return {
    robot: word(part.robot),
    user: word(part.user),
    x: part.x[i]!,
    y: part.y[i]!,
    room: word(part.room),
    trueUser: part.trueUser ? word(part.trueUser) : null,
    trueX: part.trueX?.[i] ?? NaN,
    trueY: part.trueY?.[i] ?? NaN,
  };
}

/** Whether nobody was there, or another user than the robot noticed. */
export function isFalse(sighting: Observation): boolean {
  if (sighting.trueUser === null) return false;
  return sighting.trueUser === "" || (sighting.user !== "" && sighting.trueUser !== sighting.user);
}
