/** Whole names in what is typed: upper and lower case, and `_` and a space, are alike. */

import type { EventRow, EventText } from "./events";
import { AWAY } from "./rooms";
import type { Run } from "./run";

/** A question that can't be answered as it is; its message says why. */
export class Misunderstood extends Error {
  /** A part of the question that names nothing, and what may be meant by it. */
  constructor(
    message: string,
    readonly instead: readonly [wrong: string, meant: string] | null = null,
  ) {
    super(message);
  }
}

/** A text as it is compared. */
export function normal(text: string): string {
  return text.normalize("NFC").toLowerCase().replaceAll("_", " ").trim().replaceAll(/\s+/g, " ");
}

export class Names {
  readonly bodies = new Map<string, string[]>();
  /** By name and by kind; -1 is away. */
  readonly rooms = new Map<string, Set<number>>();
  /** The most words that the name of a body has. */
  private readonly longest: number;
  private readonly known = new Set<string>();
  /** The words of each text of the events that were read. */
  private readonly ofTexts: ReadonlySet<string>[] = [];

  constructor(private readonly run: Run) {
    const { doors, rooms } = run.facts.home;
    for (const { name } of run.bodies) this.bodies.set(normal(name), [...(this.bodies.get(normal(name)) ?? []), name]);
    rooms.forEach(({ name, type }, i) => {
      for (const word of [normal(name), normal(type)]) this.rooms.set(word, (this.rooms.get(word) ?? new Set()).add(i));
    });
    if (!this.rooms.has("away")) this.rooms.set("away", new Set([AWAY]));
    if (!this.rooms.has("home")) this.rooms.set("home", new Set(rooms.keys()));
    this.longest = Math.max(1, ...[...this.bodies.keys()].map((name) => name.split(" ").length));
    const texts = [...this.bodies.keys(), ...this.rooms.keys(), ...doors.map((door) => door.name), ...run.facts.event_kinds];
    for (const unit of texts.flatMap((text) => this.units(text))) this.known.add(unit);
  }

  /** Learn the words of the events that were read since. */
  readEvents(): this {
    const { texts } = this.run.events;
    while (this.ofTexts.length < texts.length) {
      const units = this.unitsOf(texts[this.ofTexts.length]!);
      this.ofTexts.push(units);
      units.forEach((unit) => this.known.add(unit));
    }
    return this;
  }

  /** The body that a text names; undefined: it names none. As it is written, it may be of two. */
  body(text: string): string | undefined {
    const called = this.bodies.get(normal(text)) ?? [];
    const exact = called.find((name) => name === text || name === text.replaceAll(" ", "_"));
    if (!exact && called.length > 1) throw new Misunderstood(`'${text}' may be ${called.join(" or ")}: write it with the same capitals`);
    return exact ?? called[0];
  }

  room(text: string): ReadonlySet<number> | undefined {
    return this.rooms.get(normal(text));
  }

  /** The words of a text; names of bodies are one each. */
  units(text: string): string[] {
    const words = normal(text).split(" ");
    const units: string[] = [];
    for (let at = 0; at < words.length; ) {
      let length = Math.min(this.longest, words.length - at);
      while (length > 1 && !this.bodies.has(words.slice(at, at + length).join(" "))) length--;
      units.push(words.slice(at, at + length).join(" "));
      at += length;
    }
    return units.filter(Boolean);
  }

  private unitsOf({ entity, event, user, detail }: EventText): ReadonlySet<string> {
    return new Set([entity, event, user, detail].flatMap((text) => this.units(text)));
  }

  /** Tell of events whether they have all of some words. */
  having(units: readonly string[]): (row: EventRow) => boolean {
    const have = this.ofTexts.map((ofText) => units.every((unit) => ofText.has(unit)));
    return (row) => have[row.text]!;
  }

  isKnown(unit: string): boolean {
    return this.known.has(unit);
  }

  /** Why a text names nothing, with what may be meant. */
  unknown(text: string): Misunderstood {
    const events = new Set([...this.run.events.kinds, ...this.run.events.ofKind("activity").map((row) => row.detail)].map(normal));
    const names = [...this.bodies.keys(), ...this.rooms.keys(), ...events];
    const near = names.map((name) => [distance(normal(text), name), name] as const).sort(([a], [b]) => a - b)[0];
    const isNear = near && near[0] <= Math.max(1, Math.floor(text.length / 3));
    const there = isNear ? `; did you mean '${near[1]}'?` : `. There are ${names.slice(0, 14).join(", ")}, and kinds of events`;
    return new Misunderstood(`no person, room, activity or event is called '${text}'${there}`, isNear ? [text, near[1]] : null);
  }
}

const namesOfRuns = new WeakMap<Run, Names>();

/** The names of a run, as far as it is read. */
export function namesOf(run: Run): Names {
  let names = namesOfRuns.get(run);
  if (!names) namesOfRuns.set(run, (names = new Names(run)));
  return names.readEvents();
}

/** How many letters must be added, left out or replaced. */
export function distance(one: string, other: string): number {
  let row = [...Array(other.length + 1).keys()];
  for (let i = 1; i <= one.length; i++) {
    const next = [i];
    for (let j = 1; j <= other.length; j++) {
      const replaced = row[j - 1]! + Number(one[i - 1] !== other[j - 1]);
      next.push(Math.min(replaced, row[j]! + 1, next[j - 1]! + 1));
    }
    row = next;
  }
  return row[other.length]!;
}
