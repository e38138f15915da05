/**
 * Questions about a run in a few words, and the stretches of time that answer them:
 *
 *     last seen ana before 3 Mar 18:00
 *     nights ana not in bedroom
 *     ana in bathroom > 20 min
 *     astro way blocked > 1 min
 *     kitchen at 13 Jan 19:30
 */

import type { EventRow } from "./events";
import { AWAY } from "./rooms";
import type { Run } from "./run";
import { durationText } from "./clock";
import { differences, valueAt } from "./stretches";

export interface Span {
  from: number;
  to: number;
  words: string;
}

export interface Answer {
  question: string;
  spans: Span[];
  /** What was understood, or why nothing was. */
  words: string;
}

type Test = (span: { from: number; to: number }) => boolean;

/** Parts of a day: hours from the midnight that begins it. */
const PARTS: Record<string, [number, number]> = {
  nights: [22, 30],
  mornings: [6, 12],
  afternoons: [12, 18],
  evenings: [18, 22],
  days: [0, 24],
};
const UNITS: Record<string, number> = { s: 1e6, min: 60e6, h: 3600e6, d: 86_400e6 };
const HOUR_US = 3600e6;
/** Words that carry no meaning of their own. */
const FILLERS = new Set(["in", "the", "is", "was", "of", "by", "does", "did", "at", "on", "a"]);

export const EXAMPLES = ["last seen NAME", "nights NAME not in ROOM", "NAME in ROOM > 10 min", "ROOM at 18:30"];

/** The text of an event as it is shown, for searches. */
export function eventText(row: { entity: string; event: string; user: string; detail: string }): string {
  return `${row.entity} ${row.event} ${row.user} ${row.detail}`.replaceAll("_", " ").toLowerCase();
}

/** Whether a text has all of some words, in any order. */
export function hasWords(text: string, words: string): boolean {
  return words
    .toLowerCase()
    .replaceAll("_", " ")
    .split(/\s+/)
    .every((word) => text.includes(word));
}

/** When somebody is in different rooms in two runs. */
function differing(run: Run, other: Run, names: readonly string[]): Span[] {
  const bodies = run.bodies.filter((body) => names.length === 0 || names.includes(body.name.toLowerCase()));
  const spans = bodies.flatMap(({ name }) => {
    const { from, to } = differences(run.roomsOf(name), other.roomsOf(name));
    return Array.from(from, (us, i) => ({ from: us, to: to[i]!, words: `${name} is in another room` }));
  });
  return spans.sort((a, b) => a.from - b.from);
}

/** Answer a question; times without a date are on the day of `nearUs`. */
export function ask(run: Run, question: string, nearUs: number, other: Run | null = null): Answer {
  const answer = (spans: Span[], words: string): Answer => ({ question, spans, words });
  let rest = ` ${question.trim().toLowerCase().replace(/\s+/g, " ")} `;
  const moment = / at (.+) $/.exec(rest);
  if (moment) {
    const us = run.clock.parse(moment[1]!, nearUs);
    if (us === null) return answer([], `'${moment[1]}' is no time of this run: try 13 Jan 19:30, day 3 18:30, 2 d 14 h or 18:30`);
    return answer(...whereAt(run, rest.slice(0, moment.index), us));
  }
  const limits: [number, number] = [run.beginUs, run.endUs];
  const bound = / (before|until|after|since) ((?:(?! before | until | after | since ).)+) $/;
  for (let found = bound.exec(rest); found; found = bound.exec(rest)) {
    const us = run.clock.parse(found[2]!, nearUs);
    if (us === null) return answer([], `'${found[2]}' is no time of this run: try 13 Jan 19:30, day 3 18:30 or 2 d 14 h`);
    if (found[1] === "before" || found[1] === "until") limits[1] = us;
    else limits[0] = us;
    rest = `${rest.slice(0, found.index)} `;
  }
  const length = / ([<>]) ?(\d+(?:\.\d+)?) ?(s|min|h|d) /.exec(rest);
  if (length) rest = rest.replace(length[0], " ");
  const which = / (last|first) /.exec(rest)?.[1];
  const singular = (name: string): string => name.slice(0, -1); // the first night, and nights
  const part = Object.keys(PARTS).find((name) => rest.includes(` ${name} `) || rest.includes(` ${singular(name)} `));
  const words = rest.split(" ").filter((word) => word && word !== which && word !== part && !(part && word === singular(part)));
  const asksDifference = other && words.includes("differs");
  let found = asksDifference ? differing(run, other, words.filter((word) => word !== "differs")) : stretchesOf(run, words);
  if (typeof found === "string") return answer([], found);
  if (part) found = partsOfDays(run, part, found);
  const longest = length ? Number(length[2]) * UNITS[length[3]!]! : 0;
  const fits: Test = length ? ({ from, to }) => (length[1] === ">" ? to - from > longest : to - from < longest) : () => true;
  let spans = found.filter((span) => span.from >= limits[0] && span.from < limits[1] && fits(span));
  if (which) spans = which === "last" ? spans.slice(-1) : spans.slice(0, 1);
  if (spans.length === 0) return answer([], "never");
  const total = spans.reduce((sum, span) => sum + span.to - span.from, 0);
  const noun = part?.slice(0, -1) ?? "time";
  const count = `${spans.length} ${noun}${spans.length === 1 ? "" : "s"}`;
  return answer(spans, total > 0 && !part ? `${count}, ${durationText(total)} in all` : count);
}

/** What can follow the words so far: names, rooms and kinds of events. */
export function completions(run: Run, question: string, hasOther = false): string[] {
  const before = question.replace(/\S*$/, "");
  const begun = question.slice(before.length).toLowerCase();
  const { rooms } = run.facts.home;
  const words = [
    ...(before ? ["not", "in", "before", "after"] : ["last", "first", ...Object.keys(PARTS)]),
    ...run.bodies.map((body) => body.name),
    ...rooms.map((room) => room.name),
    ...rooms.map((room) => room.type),
    "away", "home", "seen",
    ...(hasOther ? ["differs"] : []),
    ...run.events.kinds.map((kind) => kind.replaceAll("_", " ")),
    ...run.events.ofKind("activity").map((row) => row.detail.replaceAll("_", " ")),
  ];
  const fitting = [...new Set(words)].filter((word) => word.startsWith(begun) && word !== begun);
  return fitting.slice(0, 12).map((word) => before + word);
}

/** Who is in a room at a moment, or where somebody is. */
function whereAt(run: Run, text: string, us: number): [Span[], string] {
  const words = text.split(" ").filter((word) => word && !FILLERS.has(word));
  const name = words.join(" ").replaceAll(" ", "_");
  const body = run.bodies.find((entry) => entry.name.toLowerCase() === name);
  const span = (found: string): [Span[], string] => [[{ from: us, to: us, words: found }], `${run.clock.text(us)}: ${found}`];
  if (body) return span(`${body.name} is ${placeName(run, valueAt(run.roomsOf(body.name), us))}`);
  const rooms = roomsCalled(run, name);
  if (rooms === null) return [[], unknown(run, words.join(" "))];
  const inside = run.bodies.filter((entry) => rooms.has(valueAt(run.roomsOf(entry.name), us) ?? NaN));
  return span(inside.length > 0 ? inside.map((entry) => entry.name).join(", ") : "nobody");
}

function placeName(run: Run, room: number | null): string {
  if (room === null) return "nowhere yet";
  return room === AWAY ? "away" : `in ${run.home.roomName(room)}`;
}

/** The rooms that a word names: a room, a kind of rooms, away or home. Null: it names none. */
function roomsCalled(run: Run, word: string): ReadonlySet<number> | null {
  const { rooms } = run.facts.home;
  if (word === "away") return new Set([AWAY]);
  if (word === "home") return new Set(rooms.keys());
  const found = [...rooms.keys()].filter((i) => [rooms[i]!.name, rooms[i]!.type].some((name) => name.toLowerCase() === word));
  return found.length > 0 ? new Set(found) : null;
}

/** The stretches in which what some words say is so; the reason where they say nothing. */
function stretchesOf(run: Run, words: readonly string[]): Span[] | string {
  const isNot = words.includes("not");
  const rest = words.filter((word) => word !== "not" && !FILLERS.has(word));
  if (rest.length === 0) return `ask for something like: ${EXAMPLES.join("; ")}`;
  const names = run.bodies.filter((body) => rest.includes(body.name.toLowerCase()));
  const others = rest.filter((word) => !names.some((body) => body.name.toLowerCase() === word)).join(" ");
  const rooms = roomsCalled(run, others.replaceAll(" ", "_"));
  if (rooms && names.length > 0) {
    const spans = names.flatMap((body) => inRooms(run, body.name, rooms, isNot));
    return spans.sort((a, b) => a.from - b.from);
  }
  if (others === "seen" && names.length > 0) return sighted(run, new Set(names.map((body) => body.name)), isNot);
  const found = happened(run, rest.join(" "));
  if (found.length > 0) return isNot ? "'not' goes with rooms and 'seen'" : found;
  return unknown(run, others || rest.join(" "));
}

function inRooms(run: Run, name: string, rooms: ReadonlySet<number>, isNot: boolean): Span[] {
  const { from, to, value } = run.roomsOf(name);
  const spans: Span[] = [];
  for (let i = 0; i < from.length; i++) {
    if (rooms.has(value[i]!) === isNot) continue;
    const last = spans[spans.length - 1];
    if (last && last.to === from[i]) last.to = to[i]!;
    else spans.push({ from: from[i]!, to: to[i]!, words: `${name} ${placeName(run, value[i]!)}` });
  }
  return spans;
}

/** When robots noticed one of some users, or a user when some robots noticed it. */
function sighted(run: Run, names: ReadonlySet<string>, isNot: boolean): Span[] {
  const step = run.clock.stepUs;
  const users = [...names].filter((name) => !run.body(name)?.robot);
  const robots = [...names].filter((name) => run.body(name)?.robot);
  const spans = run.sightings
    .filter((lane) => (users.length === 0 || users.includes(lane.user)) && (robots.length === 0 || robots.includes(lane.robot)))
    .flatMap((lane) =>
      lane.first.map((first, i) => ({
        from: first * step,
        to: (lane.last[i]! + 1) * step,
        words: `${lane.robot} sees ${lane.user || "somebody"}${lane.false[i] ? " (false)" : ""}`,
      })),
    )
    .sort((a, b) => a.from - b.from);
  return isNot ? between(spans, run, "not seen") : spans;
}

/** The gaps between stretches. */
function between(spans: readonly Span[], run: Run, words: string): Span[] {
  const gaps: Span[] = [];
  let at = run.beginUs;
  for (const span of spans) {
    if (span.from > at) gaps.push({ from: at, to: span.from, words });
    at = Math.max(at, span.to);
  }
  if (at < run.endUs) gaps.push({ from: at, to: run.endUs, words });
  return gaps;
}

/** Events whose shown text has all words; an activity lasts until the next of that body. */
function happened(run: Run, words: string): Span[] {
  const { rows } = run.events;
  const spans: Span[] = [];
  const ends = new Map<string, number>();
  const known = new Map<string, boolean>(); // few texts are different
  const fits = (row: EventRow): boolean => {
    const key = `${row.entity}/${row.event}/${row.user}/${row.detail}`;
    let is = known.get(key);
    if (is === undefined) known.set(key, (is = hasWords(eventText(row), words)));
    return is;
  };
  for (let i = rows.length - 1; i >= 0; i--) {
    const row = rows[i]!;
    const key = `${row.entity} ${row.event}`;
    if (fits(row)) {
      const lasts = row.event === "activity" || row.event === "way_blocked";
      const to = lasts ? (ends.get(row.event === "activity" ? key : row.entity) ?? run.endUs) : row.us;
      spans.push({ from: row.us, to, words: eventText(row).trim() });
    }
    ends.set(key, row.us);
    ends.set(row.entity, row.us);
  }
  return spans.reverse();
}

/** The parts of days in which stretches fill more than half. */
function partsOfDays(run: Run, part: string, spans: readonly Span[]): Span[] {
  const [begin, end] = PARTS[part]!;
  const found: Span[] = [];
  for (let day = run.clock.day(run.beginUs) - 1; run.clock.dayStart(day) < run.endUs; day++) {
    const from = Math.max(run.beginUs, run.clock.dayStart(day) + begin * HOUR_US);
    const to = Math.min(run.endUs, run.clock.dayStart(day) + end * HOUR_US);
    if (from >= to) continue;
    const filled = spans.reduce((sum, span) => sum + Math.max(0, Math.min(to, span.to) - Math.max(from, span.from)), 0);
    if (2 * filled > to - from) found.push({ from, to, words: `${part.slice(0, -1)} of ${run.clock.dateText(from)}: ${durationText(filled)}` });
  }
  return found;
}

function unknown(run: Run, words: string): string {
  const names = [...run.bodies.map((body) => body.name), ...new Set(run.facts.home.rooms.map((room) => room.type))];
  return `nothing is called '${words}'. There are ${names.slice(0, 14).join(", ")}, and kinds of events`;
}
