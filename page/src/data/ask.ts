/**
 * Questions about a run in a few words, and the stretches of time that answer them:
 *
 *     last seen ana before 3 Mar 18:00
 *     nights ana not in bedroom
 *     ana and ben in kitchen > 20 min
 *     astro way blocked > 1 min
 *     kitchen at 13 Jan 19:30
 *     where is ana now
 *     how long was ben in the kitchen
 *     ana in kitchen and ben in bedroom
 */

import type { EventKind } from "../contract";
import { DAY_US, durationText } from "./clock";
import { type EventRow, shownText } from "./events";
import { Misunderstood, namesOf, type Names } from "./names";
import { readingsOf, type Wanted } from "./phrases";
import { type Clause, clauseOf, type Group, isWord, meaningful, subjectOf, textOf, type Token, tokensOf, wrongRoomOf } from "./question";
import { AWAY } from "./rooms";
import type { Run } from "./run";
import { clipped, complement, filled, intersection, type Span, union } from "./spans";
import { differences, valueAt } from "./stretches";

export interface Answer {
  question: string;
  spans: Span[];
  /** What was understood, or why nothing was. */
  words: string;
  isUnderstood: boolean;
  /** The question that may be meant by one that isn't understood; empty: none is near. */
  meant: string;
}

type Found = Pick<Answer, "spans" | "words">;

/** Parts of a day: hours from the midnight that begins it. */
const PARTS: Record<string, [number, number]> = {
  nights: [22, 30],
  mornings: [6, 12],
  afternoons: [12, 18],
  evenings: [18, 22],
  days: [0, 24],
};
const UNITS: Record<string, number> = { s: 1e6, min: 60e6, h: 3600e6, d: DAY_US };
const HOUR_US = 3600e6;
const BOUNDS = new Set(["before", "until", "after", "since"]);
const AT = new Set(["at"]);
const NOT = new Set(["not"]);
const WITH = new Set(["with"]);
const OR = new Set(["or"]);
/** Words between clauses; "or" stands for either. */
const CLAUSE_JOINERS = new Set(["and", "or", "but", "while"]);
const NOW = "now";
const TIMES = "try now, 13 Jan 19:30, day 3 18:30, 2 d 14 h or 18:30";

export const EXAMPLES = [
  "where is NAME now",
  "who is in ROOM at 18:30",
  "last seen NAME",
  "how long was NAME in ROOM",
  "how often was NAME in ROOM",
  "longest NAME in ROOM",
  "nights NAME not in ROOM",
  "NAME in ROOM > 10 min",
];

/** Answer a question; times without a date are on the day of `nearUs`. */
export function ask(run: Run, question: string, nearUs: number, other: Run | null = null): Answer {
  if (!run.isRead.value) return { question, spans: [], words: "the run is still being read", isUnderstood: false, meant: "" };
  let problem = "";
  let meant = "";
  for (const { wanted, text } of readingsOf(question)) {
    try {
      return { question, ...new Question(run, text, wanted, nearUs, other).answer(), isUnderstood: true, meant: "" };
    } catch (error) {
      if (!(error instanceof Misunderstood)) throw error;
      problem ||= error.message;
      if (error.instead) meant ||= question.replace(...error.instead);
    }
  }
  return { question, spans: [], words: problem, isUnderstood: false, meant };
}

/** The events that have all of some words, as whole words and whole names, in any order. */
export function withWords(run: Run, rows: readonly EventRow[], words: string): EventRow[] {
  const names = namesOf(run);
  return rows.filter(names.having(names.units(words)));
}

/** What can follow the words so far: names, rooms and kinds of events. */
export function completions(run: Run, question: string, hasOther = false): string[] {
  const before = question.replace(/\S*$/, "");
  const begun = question.slice(before.length).toLowerCase();
  const { rooms } = run.facts.home;
  const words = [
    ...(before ? ["not", "in", "and", "before", "after"] : ["last", "first", ...Object.keys(PARTS)]),
    ...run.bodies.map((body) => body.name),
    ...rooms.map((room) => room.name),
    ...rooms.map((room) => room.type),
    "away", "home", "seen",
    ...(hasOther ? ["differs"] : []),
    ...run.events.kinds.map((kind) => kind.replaceAll("_", " ")),
    ...run.events.ofKind("activity").map((row) => row.detail.replaceAll("_", " ")),
  ];
  const fitting = [...new Set(words)].filter((word) => word.toLowerCase().startsWith(begun) && word !== begun);
  return fitting.slice(0, 12).map((word) => before + word);
}

interface Length {
  isLonger: boolean;
  us: number;
}

class Question {
  private readonly names: Names;
  private tokens: Token[];
  private readonly lengths: Length[] = [];
  private limits: [number, number];
  /** Why words that look like a time are none. */
  private wrongTime = "";

  constructor(
    private readonly run: Run,
    question: string,
    private readonly wanted: Wanted,
    private readonly nearUs: number,
    private readonly other: Run | null,
  ) {
    this.names = namesOf(run);
    this.limits = [run.beginUs, this.knownUs];
    const rest = question.replaceAll(/([<>])\s*(\d+(?:\.\d+)?)\s*(s|min|h|d)(?=\s|$)/gi, (_, sign: string, count: string, unit: string) => {
      this.lengths.push({ isLonger: sign === ">", us: Number(count) * UNITS[unit.toLowerCase()]! });
      return " ";
    });
    if (/[<>]/.test(rest)) throw new Misunderstood("a length is written as > 20 min or < 1.5 h, in s, min, h or d");
    this.tokens = tokensOf(rest);
  }

  /** The end of what is known of the run. */
  private get knownUs(): number {
    return Math.min(this.run.endUs, this.run.presentUs);
  }

  answer(): Found {
    const moment = this.moment();
    if (moment) return moment;
    this.readBounds();
    for (const { which, part, rest } of this.readings()) {
      const clause = clauseOf(rest, this.names);
      const found = clause ? this.spansOf(clause) : this.joined(rest);
      if (found) return this.chosen(found, which, part);
    }
    return this.events();
  }

  /** Read `ana in kitchen and ben asleep`: clauses that hold at the same time, or with `or` at any; null where there are none. */
  private joined(tokens: readonly Token[]): Span[] | null {
    for (let at = tokens.length - 2; at > 0; at--) {
      if (!isWord(tokens[at], CLAUSE_JOINERS)) continue;
      const right = clauseOf(tokens.slice(at + 1), this.names);
      if (!right) continue;
      const left = clauseOf(tokens.slice(0, at), this.names);
      const before = left ? this.spansOf(left) : this.joined(tokens.slice(0, at));
      if (!before) continue;
      // In `ana in kitchen and not seen` the second clause is about the one of the first.
      const about = right.kind === "seen" && !right.who && left?.who ? { ...right, who: left.who } : right;
      const after = this.spansOf(about);
      return isWord(tokens[at], OR) ? union([before, after]) : intersection(before, after);
    }
    return null;
  }

  /** Read a last `at TIME`: who is in a room then, where somebody is, or whether something is so. */
  private moment(): Found | null {
    for (let at = this.tokens.length - 2; at > 0; at--) {
      if (!isWord(this.tokens[at], AT)) continue;
      const us = this.timeOf(at);
      if (us === null) continue;
      const words = this.at(this.tokens.slice(0, at), us);
      if (words) return { spans: [{ from: us, to: us, words }], words: `${this.run.clock.text(us)}: ${words}` };
    }
    return null;
  }

  private at(tokens: readonly Token[], us: number): string {
    const { run } = this;
    if (isWord(tokens[0], WITH)) return this.companyAt(tokens.slice(1), us);
    const subject = subjectOf(tokens, this.names);
    if (subject && "bodies" in subject) {
      return subject.bodies.map((name) => `${run.label(name)} is ${placeName(run, valueAt(run.roomsOf(name), us))}`).join(", ");
    }
    if (subject) {
      const inside = run.bodies.filter(({ name }) => subject.rooms.has(valueAt(this.roomsOf(name), us) ?? NaN));
      return inside.map(({ name }) => run.label(name)).join(", ") || "nobody";
    }
    const clause = clauseOf(tokens, this.names);
    if (!clause) throw this.names.unknown(textOf(tokens));
    return this.spansOf(clause).some((span) => span.from <= us && us < span.to) ? "yes" : "no";
  }

  /** Read `with ana`: who else is in the room of somebody. */
  private companyAt(tokens: readonly Token[], us: number): string {
    const subject = subjectOf(tokens, this.names);
    if (!subject || !("bodies" in subject)) throw this.names.unknown(textOf(tokens));
    const rooms = new Set(subject.bodies.map((name) => valueAt(this.roomsOf(name), us)));
    const others = this.run.bodies.filter(({ name }) => !subject.bodies.includes(name) && rooms.has(valueAt(this.roomsOf(name), us)));
    const isOut = rooms.size === 1 && rooms.has(AWAY);
    return isOut ? `${subject.bodies.map((name) => this.run.label(name)).join(", ")} is out of home` : others.map(({ name }) => this.run.label(name)).join(", ") || "nobody";
  }

  /** The time that the tokens after one name; null, and a reason to tell: none of this run. */
  private timeOf(at: number): number | null {
    const text = textOf(this.tokens.slice(at + 1));
    const us = text.toLowerCase() === NOW ? this.nearUs : this.run.clock.parse(text, this.nearUs);
    if (us === null) this.wrongTime ||= `'${text}' is no time of this run: ${TIMES}`;
    return us;
  }

  /** Take `before`, `until`, `after` and `since` from the end, as long as times follow them. */
  private readBounds(): void {
    for (let at = this.tokens.length - 2; at >= 0; at--) {
      if (!isWord(this.tokens[at], BOUNDS)) continue;
      const us = this.timeOf(at);
      if (us === null) continue;
      const isEnd = ["before", "until"].includes(this.tokens[at]!.text.toLowerCase());
      this.limits = isEnd ? [this.limits[0], Math.min(us, this.limits[1])] : [Math.max(us, this.limits[0]), this.limits[1]];
      this.tokens = this.tokens.slice(0, at);
    }
  }

  /** Ways to read the tokens: `last`, `first`, `nights` and the first `night` as such where they can be, or as names. */
  private *readings(): Generator<{ which: string; part: string; rest: Token[] }> {
    const indices = (words: ReadonlySet<string>): number[] => [...this.tokens.keys()].filter((i) => isWord(this.tokens[i], words));
    const order = indices(new Set(["last", "first"]));
    const days = indices(new Set(Object.keys(PARTS).map((part) => part.slice(0, -1)))).filter((i) => order.includes(i - 1));
    for (const which of [...order, -1])
      for (const part of [...indices(new Set(Object.keys(PARTS))), ...days, -1]) {
        const word = this.tokens[part]?.text.toLowerCase() ?? "";
        const rest = this.tokens.filter((_, i) => i !== which && i !== part);
        yield { which: this.tokens[which]?.text.toLowerCase() ?? "", part: word && (word.endsWith("s") ? word : `${word}s`), rest };
      }
  }

  /** What is so of the stretches of an answer: their length, their part of days, the limits of time; the first or last. */
  private chosen(found: readonly Span[], which: string, part: string): Found {
    const [from, to] = this.limits;
    const isFitting = (us: number): boolean => this.lengths.every((length) => (length.isLonger ? us > length.us : us < length.us));
    const all = part
      ? this.partsOfDays(part, found, isFitting).filter((span) => span.from >= from && span.from < to)
      : clipped(found.filter((span) => isFitting(span.to - span.from)), from, to);
    const spans = which ? (which === "last" ? all.slice(-1) : all.slice(0, 1)) : all;
    if (spans.length === 0) return { spans, words: "never" };
    const total = spans.some((span) => span.to > span.from) ? filled(union([spans]), from, to) : 0;
    const noun = part.slice(0, -1) || "time";
    const count = `${spans.length} ${noun}${spans.length === 1 ? "" : "s"}`;
    if (this.wanted === "longest" || this.wanted === "shortest") return this.extreme(spans);
    if (this.wanted === "length" && total > 0) return { spans, words: `${durationText(total)} in all, ${durationText(total / this.days(from, to))} a day; ${count}` };
    if (this.wanted === "count") return { spans, words: `${count}, ${rate(spans.length / this.days(from, to))} a day` };
    if (this.wanted === "place") return { spans, words: this.placesOf(spans, count) };
    if (which && !part) return { spans, words: [this.run.clock.text(spans[0]!.from).slice(0, -3), total > 0 && `for ${durationText(total)}`].filter(Boolean).join(", ") };
    return { spans, words: total > 0 && !part ? `${count}, ${durationText(total)} in all` : count };
  }

  /** The days between two moments of the run, at least an hour. */
  private days(from: number, to: number): number {
    return Math.max(HOUR_US, to - from) / DAY_US;
  }

  private extreme(spans: readonly Span[]): Found {
    const sign = this.wanted === "longest" ? 1 : -1;
    const [best] = [...spans].sort((one, other) => sign * (other.to - other.from - (one.to - one.from)));
    return { spans: [best!], words: `${durationText(best!.to - best!.from)}, ${this.run.clock.text(best!.from).slice(0, -3)}` };
  }

  /** Where those were whom a question of sight names, at the first of its stretches. */
  private placesOf(spans: readonly Span[], count: string): string {
    const us = spans[0]!.from;
    const named = this.run.bodies.filter(({ name, robot }) => !robot && this.tokens.some(({ text }) => this.names.body(text) === name));
    const places = named.map(({ name }) => `${this.run.label(name)} ${placeName(this.run, valueAt(this.roomsOf(name), us))}`);
    return [places.join(", "), `${this.run.clock.text(us).slice(0, -3)}${spans.length > 1 ? ` (the first of ${count})` : ""}`].filter(Boolean).join(", ");
  }

  private spansOf(clause: Clause): Span[] {
    if (clause.kind === "rooms") return combined(clause.who, (name) => this.inRooms(name, clause.rooms, clause.isNot));
    if (clause.kind === "seen") return this.seen(clause);
    const { other, run } = this;
    if (!other) throw new Misunderstood("'differs' compares two runs: show another beside this one");
    return combined(clause.who ?? { names: run.bodies.map(({ name }) => name), any: true }, (name) => {
      const { from, to } = differences(run.roomsOf(name), other.roomsOf(name));
      return Array.from(from, (us, i) => ({ from: us, to: to[i]!, words: `${run.label(name)} is in another room` }));
    });
  }

  private roomsOf(name: string): ReturnType<Run["roomsOf"]> {
    const rooms = this.run.roomsOf(name);
    if (rooms.from.length === 0) throw new Misunderstood(`nobody knows where ${name} was: the run stored no key frames of it`);
    return rooms;
  }

  private inRooms(name: string, rooms: ReadonlySet<number>, isNot: boolean): Span[] {
    const { from, to, value } = this.roomsOf(name);
    const spans: Span[] = [];
    for (let i = 0; i < from.length; i++) {
      if (rooms.has(value[i]!) !== isNot) spans.push({ from: from[i]!, to: to[i]!, words: `${this.run.label(name)} ${placeName(this.run, value[i]!)}` });
    }
    return clipped(union([spans]), this.run.beginUs, this.knownUs);
  }

  private seen({ who, by, isNot }: Extract<Clause, { kind: "seen" }>): Span[] {
    const { run } = this;
    if (!run.storesSightings) throw new Misunderstood("the run stored no observations: nobody knows who was seen");
    const robot = who?.names.find((name) => run.body(name)?.robot);
    if (robot) throw new Misunderstood(`robots see people: 'seen by ${robot}' is when ${robot} sees somebody`);
    const person = by?.names.find((name) => !run.body(name)?.robot);
    if (person) throw new Misunderstood(`only robots see: ${person} is none`);
    const everybody: Group = { names: [""], any: true };
    return combined(who ?? everybody, (user) => combined(by ?? everybody, (name) => this.sightings(user, name, isNot)));
  }

  /** When a robot noticed a user, each of which may be left out; what it took for somebody else doesn't count. */
  private sightings(user: string, robot: string, isNot: boolean): Span[] {
    const step = this.run.clock.stepUs;
    const lanes = this.run.sightings.filter((lane) => (!user || lane.user === user) && (!robot || lane.robot === robot));
    const lists = lanes.map((lane) => {
      const words = `${this.run.label(lane.robot)} sees ${lane.user ? this.run.label(lane.user) : "somebody"}`;
      const spans = lane.first.map((first, i) => ({ from: first * step, to: (lane.last[i]! + 1) * step, words }));
      return spans.filter((_, i) => !lane.false[i]);
    });
    const { beginUs } = this.run;
    const spans = clipped(union(lists), beginUs, this.knownUs);
    const words = `${robot ? this.run.label(robot) : "Nobody"} ${robot ? "doesn't see" : "sees"} ${user ? this.run.label(user) : "anybody"}`;
    return isNot ? complement(spans, beginUs, this.knownUs, words) : spans;
  }

  /** Events that have all words; the reason where they can't be what was asked. */
  private events(): Found {
    if (this.tokens.length > 0 && this.wrongTime) throw new Misunderstood(this.wrongTime);
    const readings = [...this.readings()].flatMap((reading) =>
      [meaningful(reading.rest), reading.rest].map((tokens) => ({ ...reading, units: this.names.units(textOf(tokens)) })),
    );
    const simplest = readings[0]!;
    if (simplest.units.length === 0) throw new Misunderstood(`ask for something like: ${EXAMPLES.join("; ")}`);
    const room = wrongRoomOf(simplest.rest, this.names);
    if (room) throw this.names.unknown(room);
    if (this.tokens.some((token) => isWord(token, NOT))) throw this.misplacedNot(simplest.units);
    // Words that events have are those of events before they are a part of a day, or carry no meaning.
    const known = readings.reverse().filter(({ units }) => units.length > 0 && units.every((unit) => this.names.isKnown(unit)));
    if (known.length === 0) throw this.names.unknown(simplest.units.filter((unit) => !this.names.isKnown(unit)).join(" "));
    for (const { units, which, part } of known) {
      const found = this.happened(units);
      if (found.length === 0) continue;
      if (this.lengths.length > 0 && !part && found.every((span) => span.to === span.from)) {
        throw new Misunderstood("these events are moments: they have no length");
      }
      return this.chosen(found, which, part);
    }
    return { spans: [], words: "never: no event has all of these words" };
  }

  private misplacedNot(units: readonly string[]): Misunderstood {
    const unknown = units.find((unit) => unit !== "not" && !this.names.isKnown(unit));
    return unknown ? this.names.unknown(unknown) : new Misunderstood("'not' goes with rooms and 'seen'");
  }

  /** An activity lasts until the next of that body, a blocked way until the next event of that robot but a sighting. */
  private happened(units: readonly string[]): Span[] {
    const { rows, texts } = this.run.events;
    const isWanted = this.names.having(units);
    const words = texts.map((text) => `${text.entity && this.run.label(text.entity)} ${shownText(text)}`.trim());
    const spans: Span[] = [];
    const activityEnds = new Map<string, number>();
    const ends = new Map<string, number>();
    for (let i = rows.length - 1; i >= 0; i--) {
      const row = rows[i]!;
      if (isWanted(row)) {
        const next = row.event === "activity" ? activityEnds : row.event === "way_blocked" ? ends : null;
        spans.push({ from: row.us, to: next ? (next.get(row.entity) ?? this.knownUs) : row.us, words: words[row.text]! });
      }
      if (row.event === "activity") activityEnds.set(row.entity, row.us);
      if (!SIGHTS.has(row.event)) ends.set(row.entity, row.us);
    }
    return spans.reverse();
  }

  /**
   * The parts of days in which stretches fill more than half, or as much as is asked for; or in which one of
   * them is, if they are moments.
   */
  private partsOfDays(part: string, found: readonly Span[], isFitting: (us: number) => boolean): Span[] {
    const { clock, beginUs } = this.run;
    const [begin, end] = PARTS[part]!;
    const spans = union([found]);
    const parts: Span[] = [];
    for (let day = clock.day(beginUs) - 1; clock.dayStart(day) < this.knownUs; day++) {
      const from = Math.max(beginUs, clock.dayStart(day) + begin * HOUR_US);
      const to = Math.min(this.knownUs, clock.dayStart(day) + end * HOUR_US);
      if (from >= to) continue;
      const time = filled(spans, from, to);
      const isMoment = spans.some((span) => span.from === span.to && span.from >= from && span.from < to);
      if (this.lengths.length > 0 ? isFitting(time) : isMoment || 2 * time > to - from) {
        parts.push({ from, to, words: `${part.slice(0, -1)} of ${clock.dateText(from)}: ${durationText(time)}` });
      }
    }
    return parts;
  }
}

const SIGHTS = new Set<EventKind>(["user_seen", "user_lost", "robot_seen", "robot_lost"]);

/** What holds of all of a group at the same time, or of any of it. */
function combined({ names, any }: Group, spansOf: (name: string) => Span[]): Span[] {
  const lists = names.map(spansOf);
  return any ? union(lists) : lists.reduce(intersection);
}

function rate(count: number): string {
  return count >= 10 ? count.toFixed(0) : count.toFixed(1);
}

function placeName(run: Run, room: number | null): string {
  if (room === null) return "nowhere yet";
  return room === AWAY ? "out of home" : `in ${run.home.labels[room]!}`;
}
