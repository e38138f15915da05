/** The lanes of a timeline: what each shows, in which colours. */

import type { Answer } from "../data/ask";
import { type BeliefSeries, percents } from "../data/beliefs";
import { kindOf } from "../data/activities";
import type { Clock } from "../data/clock";
import type { Run, Switches } from "../data/run";
import type { BodyFacts, EventKind } from "../contract";
import { type EventRow, shownText } from "../data/events";
import { firstAtLeast, lastAtMost } from "../data/search";
import { differences, type Stretches, valueAt } from "../data/stretches";
import { title } from "../data/words";
import { chosenBelief, errorsOf } from "../plan/beliefs";
import { bodyColor, colors, dark, mix, PALETTE } from "../theme";
import { type Series, readSeries } from "../data/metrics";
import type { Group } from "./rows";

export interface Lane {
  id: string;
  label: string;
  height: number;
  group: Group;
  /** Whether it stays when the lanes of its body are folded. */
  isMain: boolean;
  /** What is under a moment, in words; empty where there is nothing. */
  words: (us: number) => string;
  /** What is drawn; computed when the lane is seen first. */
  paint: () => LanePaint;
  /** The body, door or room that a click on the label shows. */
  subject: string;
}

export type LanePaint =
  | {
      kind: "stretches";
      stretches: Stretches;
      color: (value: number) => string | null;
      label: (value: number) => string;
      /** Which value is drawn where several are within a pixel; without it, that which lasts longest. */
      rank?: (value: number) => number;
    }
  | { kind: "ticks"; us: readonly number[]; color: string }
  | { kind: "line"; series: Series; extent: readonly [number, number]; color: string }
  | { kind: "heat"; beliefs: BeliefSeries; rows: readonly number[]; names: readonly string[]; truth: Stretches; color: string; endUs: number };

/** Every word keeps its colour, in all lanes of all runs. */
const colorOfWord = new Map<string, string>();

function wordColor(word: string): string {
  let color = colorOfWord.get(word);
  if (!color) {
    color = PALETTE[colorOfWord.size % PALETTE.length]!;
    colorOfWord.set(word, color);
  }
  return color;
}

const SEEN_KINDS: readonly EventKind[] = ["user_seen", "user_lost"];
const ROUTINE_KINDS = new Set<EventKind>(["activity", "left_home", "came_home", "opened", "shut", ...SEEN_KINDS]);

export function lanesOf(run: Run, prefix: string, other: Run | null, title = ""): Lane[] {
  const lanes = ownLanes(run, prefix, other);
  if (title) lanes.forEach((lane) => (lane.label = `${lane.label} · ${title}`));
  return lanes;
}

const HEAT_ROW_HEIGHT = 12;
const MIN_HEAT = 0.1;

/** What is believed of each room over time, the true room drawn over it, and the error below. */
export function beliefLanes(run: Run, prefix: string, title = ""): Lane[] {
  const chosen = chosenBelief(run);
  const beliefs = chosen?.beliefs.of(chosen.user);
  if (!chosen || !beliefs) return [];
  const { rooms } = run.facts.home;
  const place = (value: number): number => (value < 0 ? rooms.length : value);
  const lane = run.roomsOf(chosen.user);
  const truth: Stretches = { ...lane, value: [...lane.value].map(place) };
  const been = new Set(truth.value);
  const rows = [...rooms.keys(), rooms.length].filter(
    (room) => been.has(room) || beliefs.shares.some((shares) => shares[room]! > MIN_HEAT),
  );
  const name = (room: number): string => rooms[room]?.name ?? "away";
  const label = [`${chosen.beliefs.name} of ${chosen.user}`, title].filter(Boolean).join(" · ");
  const color = bodyColor(run.body(chosen.user)?.color ?? "#0077bb");
  const words = (us: number): string => {
    const at = lastAtMost(beliefs.us, us);
    if (at < 0) return "";
    const ofRooms = percents(beliefs.shares[at]!);
    const likeliest = [...rows].sort((one, other) => ofRooms[other]! - ofRooms[one]!).slice(0, 3);
    const believed = likeliest.map((room) => `${name(room)} ${ofRooms[room]} %`);
    const room = valueAt(truth, us);
    return `as of ${run.clock.text(beliefs.us[at]!)}: ${believed.join(", ")}${room === null ? "" : `; true: ${name(room)}`}`;
  };
  const paint: LanePaint = { kind: "heat", beliefs, rows, names: rows.map(name), truth, color, endUs: run.endUs };
  const height = rows.length * HEAT_ROW_HEIGHT;
  const heat: Lane = { id: `${prefix}belief`, label, height, group: "Beliefs", isMain: true, words, paint: () => paint, subject: chosen.user };
  const error = errorsOf(run, chosen);
  return [heat, { ...lineLane(run.clock, prefix, label, error), label: `error of ${label}`, group: "Beliefs" }];
}

/** What answers the question that was asked; its words are those of each mark. */
export function answerLane(answer: Answer): Lane {
  const { spans } = answer;
  const stretches: Stretches = {
    from: spans.map((span) => span.from),
    // A moment is as wide as a pixel; it is drawn as if it lasted a microsecond.
    to: spans.map((span) => Math.max(span.to, span.from + 1)),
    value: spans.map((_, i) => i),
  };
  const words = (value: number): string => spans[value]?.words ?? "";
  const color = (): string => colors.value.cursor;
  return stretchLane({ id: "answer", label: answer.question, subject: "", group: "Answers", height: 16 }, () => stretches, color, words, () => 1);
}

/** The notes and bookmarks of a run. */
export function noteLane(run: Run): Lane[] {
  const notes = run.notes.value;
  if (notes.length === 0) return [];
  const us = notes.map((note) => note.step * run.clock.stepUs);
  const words = (at: number): string => notes[lastAtMost(us, at)]?.text ?? "";
  return [tickLane({ id: "notes", label: "notes", subject: "", group: "Answers", height: 14 }, () => us, colors.value.cursor, words)];
}

/** What a lane is called and where it stands; the lanes of a body are in its group. */
type Place = Pick<Lane, "id" | "label" | "subject" | "group" | "height"> & { isMain?: boolean };

function stretchLane(
  place: Place,
  stretches: () => Stretches,
  color: (value: number) => string | null,
  words: (value: number) => string,
  rank?: (value: number) => number,
): Lane {
  const paint = once((): LanePaint => ({ kind: "stretches", stretches: stretches(), color, label: words, ...(rank && { rank }) }));
  const wordsAt = (us: number): string => {
    const { from, to, value } = stretchesOf(paint());
    const i = firstAtLeast(to, us + 1);
    return i < from.length && from[i]! <= us ? words(value[i]!) : "";
  };
  return { isMain: false, ...place, words: wordsAt, paint };
}

function stretchesOf(paint: LanePaint): Stretches {
  return paint.kind === "stretches" ? paint.stretches : { from: [], to: [], value: [] };
}

function once<T>(compute: () => T): () => T {
  let value: T | undefined;
  return () => (value ??= compute());
}

function ownLanes(run: Run, prefix: string, other: Run | null): Lane[] {
  const bodies = run.bodies.flatMap((body) => {
    const kinds = run.events.kindsOf(body.name);
    const group: Group = body.robot ? "Robots" : "Users";
    const lanes = [roomLane(run, body.name, prefix, group)];
    if (other) lanes.push(differenceLane(run, other, body.name, prefix, group));
    if (body.robot && run.decisions?.of(body.name)) lanes.push(decisionLane(run, body.name, prefix, group));
    if (kinds.includes("activity")) lanes.push(activityLane(run, body.name, prefix, group));
    if (kinds.some((kind) => !ROUTINE_KINDS.has(kind))) lanes.push(eventLane(run, body, prefix, group));
    return lanes;
  });
  return [...bodies, ...requestLanes(run, prefix), ...sightingLanes(run, prefix), ...outputLanes(run, prefix), ...markLanes(run, prefix), ...switchLanes(run, prefix)];
}

function roomLane(run: Run, name: string, prefix: string, group: Group): Lane {
  const rooms = run.facts.home.rooms;
  const color = (value: number): string | null => {
    const deep = rooms[value]?.deep_color;
    return deep ? (dark.value ? mix(deep, "#16181c", 0.25) : deep) : null;
  };
  const place = { id: `${prefix}${name}/room`, label: run.label(name), subject: name, group, height: 20, isMain: true };
  return stretchLane(place, () => run.roomsOf(name), color, (value) => run.home.roomLabel(value));
}

/** A live run is known once a minute: shorter differences from it may be none. */
const LIVE_MINIMUM_US = 61e6;

function differenceLane(run: Run, other: Run, name: string, prefix: string, group: Group): Lane {
  const place = { id: `${prefix}${name}/differs`, label: `${run.label(name)}: rooms differ`, subject: name, group, height: 10, isMain: true };
  const minimum = Math.min(run.knownUs, other.knownUs) < Infinity ? LIVE_MINIMUM_US : 0;
  const apart = (): Stretches => longerThan(differences(run.roomsOf(name), other.roomsOf(name)), minimum);
  return stretchLane(place, apart, () => colors.value.alarm, () => "another room", () => 1);
}

function longerThan({ from, to, value }: Stretches, minimum: number): Stretches {
  const kept = [...from.keys()].filter((i) => to[i]! - from[i]! > minimum);
  return { from: kept.map((i) => from[i]!), to: kept.map((i) => to[i]!), value: kept.map((i) => value[i]!) };
}

function activityLane(run: Run, name: string, prefix: string, group: Group): Lane {
  const words: string[] = [];
  const stretches = (): Stretches => {
    const rows = run.events.of(name, "activity");
    words.push(...new Set(rows.map((row) => row.detail)));
    const code = new Map(words.map((word, i) => [word, i]));
    return {
      from: rows.map((row) => row.us),
      to: rows.map((_, i) => rows[i + 1]?.us ?? run.presentUs),
      value: rows.map((row) => code.get(row.detail)!),
    };
  };
  const place = { id: `${prefix}${name}/activity`, label: `${run.label(name)} does`, subject: name, group, height: 16 };
  return stretchLane(place, stretches, (value) => kindOf(words[value] ?? "").color, (value) => words[value] ?? "");
}

/** Which behavior of a body decided, and why. */
function decisionLane(run: Run, name: string, prefix: string, group: Group): Lane {
  const { us, behavior, reason } = run.decisions!.of(name)!;
  const stretches = (): Stretches => ({ from: us, to: us.map((_, i) => us[i + 1] ?? run.presentUs), value: us.map((_, i) => i) });
  const words = (i: number): string => [behavior[i], reason[i]].filter(Boolean).join(": ").replaceAll("_", " ");
  const place = { id: `${prefix}${name}/decisions`, label: `${run.label(name)}: behavior`, subject: name, group, height: 16 };
  return stretchLane(place, stretches, (i) => (behavior[i] ? wordColor(behavior[i]!) : null), words);
}

function sightingLanes(run: Run, prefix: string): Lane[] {
  return run.sightings.map((lane) => {
    const step = run.clock.stepUs;
    const stretches = (): Stretches => ({
      from: lane.first.map((first) => first * step),
      to: lane.last.map((last) => (last + 1) * step),
      value: lane.false.map(Number),
    });
    const color = bodyColor(run.body(lane.user)?.color ?? "#0077bb");
    const label = `${run.label(lane.robot)} sees ${lane.user ? run.label(lane.user) : "somebody"}`;
    const words = (value: number): string => (value ? "false observation" : "noticed");
    const paint = (value: number): string => (value ? colors.value.alarm : color);
    const place = { id: `${prefix}${lane.robot}/sees/${lane.user}`, label, subject: lane.robot, group: "Robots" as const, height: 12 };
    return stretchLane(place, stretches, paint, words, (value) => value);
  });
}

function tickLane(place: Place, us: () => readonly number[], color: string, words: (us: number) => string = () => ""): Lane {
  return { isMain: false, ...place, words, paint: once((): LanePaint => ({ kind: "ticks", us: us(), color })) };
}

function eventLane(run: Run, body: BodyFacts, prefix: string, group: Group): Lane {
  const rows = once(() => run.events.ofEntity(body.name).filter((row) => !ROUTINE_KINDS.has(row.event)));
  const us = once(() => rows().map((row) => row.us));
  const words = (at: number): string => {
    const row = rows()[lastAtMost(us(), at)];
    return row ? `${shownText(row)} (${run.clock.text(row.us)})` : "";
  };
  const place = { id: `${prefix}${body.name}/events`, label: `${run.label(body.name)} events`, subject: body.name, group, height: 12 };
  return tickLane(place, us, bodyColor(body.color), words);
}

const OUTCOMES = ["accepted", "declined", "sent away", "no answer", "expired", "open"];
const OUTCOME_COLORS = ["#009988", "#ee7733", "#cc3311", "#bbbbbb", "#9a9a9a", "#77aadd"];
const NO_ANSWER = OUTCOMES.indexOf("no answer");
const OPEN = OUTCOMES.indexOf("open");
/** Events that end a request, and what came of it; after others the robot may try again. */
const ENDS = new Map<EventKind, number>([
  ["accepted", 0],
  ["declined", 1],
  ["sent_away", 2],
  ["banned", 2],
  ["switched_off", 2],
  ["expired", OUTCOMES.indexOf("expired")],
]);

/** A request of a robot, from when it came up to what came of it. */
interface Request {
  from: number;
  to: number;
  lastUs: number;
  outcome: number;
  asks: number;
}

/** A lane for each interaction of a robot and a person: from when a request came up to what came of it. */
function requestLanes(run: Run, prefix: string): Lane[] {
  const robots = run.bodies.filter((body) => body.robot && run.events.kindsOf(body.name).includes("due"));
  return robots.flatMap(({ name }) => {
    const rows = run.events.ofEntity(name);
    const texts = [...new Set(run.events.of(name, "due").map((row) => row.detail))].sort();
    return texts.map((text) => {
      const requests = once(() => requestsOf(rows, text, run.presentUs));
      const stretches = once((): Stretches => ({
        from: requests().map((request) => request.from),
        to: requests().map((request) => request.to),
        value: requests().map((request) => request.outcome),
      }));
      const place = { id: `${prefix}${name}/request/${text}`, label: `${run.label(name)}: ${text}`, subject: name, group: "Robots" as const, height: 12 };
      const lane = stretchLane(place, stretches, (value) => OUTCOME_COLORS[value]!, (value) => OUTCOMES[value]!, (value) => OPEN - value);
      const words = (us: number): string => {
        const request = requests()[lastAtMost(stretches().from, us)];
        if (!request || us >= request.to) return "";
        const minutes = Math.round((request.to - request.from) / 60e6);
        const lasts = request.outcome === OPEN ? "for" : "after";
        return `${OUTCOMES[request.outcome]!} ${lasts} ${minutes} min, asked ${request.asks === 1 ? "once" : `${request.asks} times`}`;
      };
      return { ...lane, words };
    });
  });
}

function requestsOf(rows: readonly EventRow[], text: string, endUs: number): Request[] {
  const requests: Request[] = [];
  for (const { us, event, detail } of rows) {
    // An event by which the robot is sent away names the room, too.
    if (detail !== text && !detail.startsWith(`${text} `)) continue;
    const last = requests.at(-1);
    const isOpen = last?.outcome === OPEN;
    if (event === "due") {
      if (isOpen) [last.to, last.outcome] = [last.lastUs, NO_ANSWER]; // the robot has given up
      requests.push({ from: us, to: endUs, lastUs: us, outcome: OPEN, asks: 0 });
    }
    if (!isOpen || event === "due") continue;
    last.lastUs = us;
    if (event === "asks") last.asks += 1;
    const outcome = ENDS.get(event);
    if (outcome !== undefined) [last.to, last.outcome] = [us, outcome];
  }
  return requests;
}

function outputLanes(run: Run, prefix: string): Lane[] {
  return run.beliefs.map((entry) => {
    const place = { id: `${prefix}${entry.name}/outputs`, label: `${entry.name} outputs`, subject: "", group: "Algorithms" as const, height: 12 };
    return tickLane(place, () => entry.moments, colors.value.quiet);
  });
}

const MARK_KINDS = ["intervention", "held", "violated", "open"] as const;
const MARK_WORDS = { intervention: "done", held: "held", violated: "violated", open: "not decided" };
const MARK_RANKS = [0, 1, 3, 2];

/** Interventions as ticks, and a lane for each expectation: held, violated, or not decided. */
function markLanes(run: Run, prefix: string): Lane[] {
  const step = run.clock.stepUs;
  const names = [...new Set(run.facts.marks.map((mark) => mark.lane))];
  return names.map((name) => {
    const marks = run.facts.marks.filter((mark) => mark.lane === name);
    const us = marks.map((mark) => mark.step * step);
    const words = (at: number): string => {
      const last = lastAtMost(us, at);
      const mark = marks[last];
      if (!mark) return "";
      // An intervention is a moment: it is named as long as nothing else was done.
      if (mark.kind !== "intervention" && at >= mark.end * step) return "";
      return `${MARK_WORDS[mark.kind]}: ${mark.label}`;
    };
    const place = { id: `${prefix}${name}/marks`, label: name, subject: "", group: "Script" as const, height: 12 };
    if (marks.every((mark) => mark.kind === "intervention")) return tickLane(place, () => us, colors.value.text, words);
    const shades = [colors.value.text, dark.value ? "#2fb6a3" : "#009988", colors.value.alarm, colors.value.quiet];
    const stretches: Stretches = {
      from: us,
      to: marks.map((mark) => mark.end * step),
      value: marks.map((mark) => MARK_KINDS.indexOf(mark.kind)),
    };
    const label = (value: number): string => MARK_WORDS[MARK_KINDS[value]!];
    const lane = stretchLane({ ...place, label: `${name}: expected` }, () => stretches, (value) => shades[value]!, label, (value) => MARK_RANKS[value]!);
    return { ...lane, words };
  });
}

/** Doors while they are shut, and lights while they are on. */
function switchLanes(run: Run, prefix: string): Lane[] {
  const { doors, rooms } = run.facts.home;
  const lane = (name: string, label: string, words: [string, string], marked: 0 | 1, color: string, isOn: boolean, switches: () => Switches): Lane => {
    const stretches = (): Stretches => {
      const { us: moments, on: states } = switches();
      const us = [0, ...moments];
      return { from: us, to: us.map((_, i) => us[i + 1] ?? run.presentUs), value: [isOn, ...states].map(Number) };
    };
    const place = { id: `${prefix}${name}/${words[marked]}`, label, subject: name, group: "Doors and sensors" as const, height: 10 };
    return stretchLane(place, stretches, (value) => (value === marked ? color : null), (value) => words[value]!, (value) => Number(value === marked));
  };
  const lit = run.hasLights ? rooms.filter((room) => run.lightEvents(room.name).us.length > 0) : [];
  const { door, viewEdge } = colors.value;
  return [
    ...doors.map(({ name, open }) => lane(name, `${title(name)} shut`, ["shut", "open"], 0, door, open, () => run.doorEvents(name))),
    ...lit.map(({ name }) => lane(name, `${run.home.roomLabel(run.home.roomIndex(name))} light`, ["light off", "light on"], 1, viewEdge, !run.facts.starts_unlit, () => run.lightEvents(name))),
  ];
}

/** Lanes of metrics and sensors, which are read from their tables. */
export async function tableLanes(run: Run, prefix: string): Promise<Lane[]> {
  const lanes: Lane[] = [];
  for (const facts of run.facts.tables) {
    if (facts.role !== "metric" && facts.name !== "sensors") continue;
    await run.attempt(async () => {
      const table = await run.open(facts.name);
      if (!table) return;
      if (facts.name === "sensors") lanes.push(...(await sensorLanes(run, prefix)));
      else {
        const series = await readSeries(facts, table, run.clock.stepUs);
        const first = series[0];
        if (first && first.us.length > 1) lanes.push(lineLane(run.clock, prefix, facts.name, first));
      }
    });
  }
  return lanes;
}

function lineLane(clock: Clock, prefix: string, name: string, series: Series): Lane {
  const words = (us: number): string => {
    const i = lastAtMost(series.us, us);
    const value = series.values[i];
    return value === undefined || Number.isNaN(value) ? "" : `${series.name}: ${value.toPrecision(3)}, as of ${clock.text(series.us[i]!)}`;
  };
  const paint: LanePaint = { kind: "line", series, extent: extentOf(series), color: colors.value.text };
  const place = { id: `${prefix}${name}/metric`, label: `${name} ${series.name}`, subject: "", group: "Metrics" as const, height: 24 };
  return { ...place, isMain: false, words, paint: () => paint };
}

async function sensorLanes(run: Run, prefix: string): Promise<Lane[]> {
  const table = (await run.open("sensors"))!;
  const steps = await table.numbers("step");
  const sensor = await table.words("sensor");
  const state = await table.words("state");
  const rows = rowsByCode(sensor.codes, sensor.words.length);
  return sensor.words.map((name, code) => {
    const us = rows[code]!.map((row) => steps[row]! * run.clock.stepUs);
    const on = rows[code]!.map((row) => Number(["ON", "OPEN", "PRESENT"].includes((state.words[state.codes[row]!] ?? "").toUpperCase())));
    const stretches: Stretches = { from: us, to: us.map((_, i) => us[i + 1] ?? run.presentUs), value: on };
    const color = (value: number): string | null => (value ? "#44aa99" : null);
    const place = { id: `${prefix}${name}/sensor`, label: name, subject: name, group: "Doors and sensors" as const, height: 10 };
    return stretchLane(place, () => stretches, color, (value) => (value ? "on" : "off"), (value) => value);
  });
}

function rowsByCode(codes: Int32Array, count: number): number[][] {
  const rows: number[][] = Array.from({ length: count }, () => []);
  codes.forEach((code, row) => rows[code]?.push(row));
  return rows;
}

/** The least value, or 0, and the greatest one. */
function extentOf({ values }: Series): [number, number] {
  let [low, high] = [0, 1e-12];
  for (const value of values) {
    if (value < low) low = value;
    if (value > high) high = value;
  }
  return [low, high];
}
