/** The lanes of a timeline: what each shows, in which colours. */

import type { Answer } from "../data/ask";
import type { BeliefSeries } from "../data/beliefs";
import type { Run } from "../data/run";
import { lastAtMost } from "../data/search";
import { differences, type Stretches, valueAt } from "../data/stretches";
import { chosenBelief, errorsOf } from "../plan/beliefs";
import { bodyColor, colors, dark, mix } from "../theme";
import { type Series, readSeries } from "../data/metrics";

export interface Lane {
  id: string;
  label: string;
  height: number;
  /** What is under a moment, in words; empty where there is nothing. */
  words: (us: number) => string;
  paint: LanePaint;
  /** The body, door or room that a click on the label shows. */
  subject: string;
}

export type LanePaint =
  | { kind: "stretches"; stretches: Stretches; color: (value: number) => string | null; label: (value: number) => string }
  | { kind: "ticks"; us: readonly number[]; color: string }
  | { kind: "line"; series: Series; color: string }
  | { kind: "heat"; beliefs: BeliefSeries; rows: readonly number[]; truth: Stretches; color: string; endUs: number };

/** Distinct colours with any kind of colour blindness (Paul Tol's muted scheme). */
const WORD_COLORS = ["#88ccee", "#ddcc77", "#cc6677", "#44aa99", "#aa4499", "#999933", "#332288", "#117733", "#882255"];
/** Every word keeps its colour, in all lanes of all runs. */
const colorOfWord = new Map<string, string>();

function wordColor(word: string): string {
  let color = colorOfWord.get(word);
  if (!color) {
    color = WORD_COLORS[colorOfWord.size % WORD_COLORS.length]!;
    colorOfWord.set(word, color);
  }
  return color;
}

const SEEN_KINDS = ["user_seen", "user_lost"];
const ROUTINE_KINDS = new Set(["activity", "left_home", "came_home", "opened", "shut", ...SEEN_KINDS]);

export function lanesOf(run: Run, prefix: string, other: Run | null, title = ""): Lane[] {
  const lanes = ownLanes(run, prefix, other);
  if (title) lanes.forEach((lane) => (lane.label = `${title}: ${lane.label}`));
  return lanes;
}

const HEAT_ROW_HEIGHT = 9;
const MIN_HEAT = 0.02;

/** What is believed of each room over time, the true room drawn over it, and the error below. */
export function beliefLanes(run: Run): Lane[] {
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
  const label = `${chosen.beliefs.name} of ${chosen.user}`;
  const color = bodyColor(run.body(chosen.user)?.color ?? "#0077bb");
  const words = (us: number): string => {
    const at = lastAtMost(beliefs.us, us);
    if (at < 0) return "";
    const shares = rows.map((room) => [room, beliefs.shares[at]![room]!] as const).sort((one, other) => other[1] - one[1]);
    const believed = shares.slice(0, 3).map(([room, share]) => `${name(room)} ${(100 * share).toFixed(0)} %`);
    const room = valueAt(truth, us);
    return `${believed.join(", ")}${room === null ? "" : `; true: ${name(room)}`}`;
  };
  const paint: LanePaint = { kind: "heat", beliefs, rows, truth, color, endUs: run.endUs };
  const heat = { id: "belief", label, height: rows.length * HEAT_ROW_HEIGHT, words, paint, subject: chosen.user };
  const error = errorsOf(run, chosen);
  return [heat, { ...lineLane("", label, error), label: `${label}: error` }];
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
  return stretchLane("answer", answer.question, "", stretches, () => colors.value.cursor, words, 16);
}

function ownLanes(run: Run, prefix: string, other: Run | null): Lane[] {
  const lanes: Lane[] = [];
  for (const body of run.bodies) {
    lanes.push(roomLane(run, body.name, prefix));
    if (other) lanes.push(differenceLane(run, other, body.name, prefix));
    const activity = activityLane(run, body.name, prefix);
    if (activity) lanes.push(activity);
  }
  lanes.push(...sightingLanes(run, prefix), ...eventLanes(run, prefix), ...outputLanes(run, prefix));
  lanes.push(...markLanes(run, prefix), ...doorLanes(run, prefix));
  return lanes;
}

function stretchWords(stretches: Stretches, label: (value: number) => string): (us: number) => string {
  return (us) => {
    for (let low = 0, high = stretches.from.length; low < high; ) {
      const middle = (low + high) >> 1;
      if (stretches.to[middle]! <= us) low = middle + 1;
      else if (stretches.from[middle]! > us) high = middle;
      else return label(stretches.value[middle]!);
    }
    return "";
  };
}

function stretchLane(
  id: string,
  label: string,
  subject: string,
  stretches: Stretches,
  color: (value: number) => string | null,
  words: (value: number) => string,
  height = 16,
): Lane {
  const paint: LanePaint = { kind: "stretches", stretches, color, label: words };
  return { id, label, subject, height, words: stretchWords(stretches, words), paint };
}

function roomLane(run: Run, name: string, prefix: string): Lane {
  const rooms = run.facts.home.rooms;
  const color = (value: number): string | null => {
    const deep = rooms[value]?.deep_color;
    return deep ? (dark.value ? mix(deep, "#16181c", 0.25) : deep) : null;
  };
  return stretchLane(`${prefix}${name}/room`, name, name, run.roomsOf(name), color, (value) => run.home.roomName(value), 20);
}

function differenceLane(run: Run, other: Run, name: string, prefix: string): Lane {
  const apart = differences(run.roomsOf(name), other.roomsOf(name));
  const label = `${name}: rooms differ`;
  return stretchLane(`${prefix}${name}/differs`, label, name, apart, () => colors.value.alarm, () => "another room", 10);
}

function activityLane(run: Run, name: string, prefix: string): Lane | null {
  const rows = run.events.ofKind("activity").filter((row) => row.entity === name);
  if (rows.length === 0) return null;
  const words = [...new Set(rows.map((row) => row.detail))];
  const stretches: Stretches = {
    from: rows.map((row) => row.us),
    to: rows.map((_, i) => rows[i + 1]?.us ?? run.presentUs),
    value: rows.map((row) => words.indexOf(row.detail)),
  };
  const color = (value: number): string => wordColor(words[value] ?? "");
  return stretchLane(`${prefix}${name}/activity`, `${name} does`, name, stretches, color, (value) => words[value] ?? "");
}

function sightingLanes(run: Run, prefix: string): Lane[] {
  return run.sightings.map((lane) => {
    const step = run.clock.stepUs;
    const stretches: Stretches = {
      from: lane.first.map((first) => first * step),
      to: lane.last.map((last) => (last + 1) * step),
      value: lane.false.map(Number),
    };
    const color = bodyColor(run.body(lane.user)?.color ?? "#0077bb");
    const label = `${lane.robot} sees ${lane.user || "somebody"}`;
    const words = (value: number): string => (value ? "false observation" : "noticed");
    const paint = (value: number): string => (value ? colors.value.alarm : color);
    return stretchLane(`${prefix}${lane.robot}/sees/${lane.user}`, label, lane.robot, stretches, paint, words, 12);
  });
}

function tickLane(id: string, label: string, subject: string, us: readonly number[], color: string): Lane {
  return { id, label, subject, height: 12, words: () => "", paint: { kind: "ticks", us, color } };
}

function eventLanes(run: Run, prefix: string): Lane[] {
  const lanes: Lane[] = [];
  for (const body of run.bodies) {
    const rows = run.events.rows.filter((row) => row.entity === body.name && !ROUTINE_KINDS.has(row.event));
    if (rows.length > 0) {
      const us = rows.map((row) => row.us);
      lanes.push(tickLane(`${prefix}${body.name}/events`, `${body.name} events`, body.name, us, bodyColor(body.color)));
    }
  }
  return lanes;
}

function outputLanes(run: Run, prefix: string): Lane[] {
  return run.beliefs.map((entry) =>
    tickLane(`${prefix}${entry.name}/outputs`, `${entry.name} outputs`, "", entry.moments, colors.value.quiet),
  );
}

const MARK_KINDS = ["intervention", "held", "violated", "open"] as const;
const MARK_WORDS = { intervention: "done", held: "held", violated: "violated", open: "not decided" };

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
    if (marks.every((mark) => mark.kind === "intervention")) {
      return { ...tickLane(`${prefix}${name}/marks`, name, "", us, colors.value.text), words };
    }
    const shades = [colors.value.text, dark.value ? "#2fb6a3" : "#009988", colors.value.alarm, colors.value.quiet];
    const stretches: Stretches = {
      from: us,
      to: marks.map((mark) => mark.end * step),
      value: marks.map((mark) => MARK_KINDS.indexOf(mark.kind)),
    };
    const paint = (value: number): string => shades[value]!;
    const lane = stretchLane(`${prefix}${name}/marks`, `${name}: expected`, "", stretches, paint, (value) => MARK_WORDS[MARK_KINDS[value]!], 12);
    return { ...lane, words };
  });
}

function doorLanes(run: Run, prefix: string): Lane[] {
  return run.facts.home.doors.map((door) => {
    const rows = run.events.rows.filter(
      (row) => row.entity === door.name && (row.event === "opened" || row.event === "shut"),
    );
    const us = [0, ...rows.map((row) => row.us)];
    const open = [door.open, ...rows.map((row) => row.event === "opened")];
    const stretches: Stretches = {
      from: us,
      to: us.map((_, i) => us[i + 1] ?? run.presentUs),
      value: open.map(Number),
    };
    const color = (value: number): string | null => (value ? null : colors.value.door);
    return stretchLane(`${prefix}${door.name}/door`, `${door.name} shut`, door.name, stretches, color, (value) => (value ? "open" : "shut"), 10);
  });
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
        if (first && first.us.length > 1) lanes.push(lineLane(prefix, facts.name, first));
      }
    });
  }
  return lanes;
}

function lineLane(prefix: string, name: string, series: Series): Lane {
  const words = (us: number): string => {
    const i = series.us.findIndex((at) => at >= us);
    const value = series.values[i < 0 ? series.values.length - 1 : i];
    return value === undefined || Number.isNaN(value) ? "" : `${series.name}: ${value.toPrecision(3)}`;
  };
  const paint: LanePaint = { kind: "line", series, color: colors.value.text };
  return { id: `${prefix}${name}/metric`, label: `${name} ${series.name}`, subject: "", height: 24, words, paint };
}

async function sensorLanes(run: Run, prefix: string): Promise<Lane[]> {
  const table = (await run.open("sensors"))!;
  const steps = await table.numbers("step");
  const sensor = await table.words("sensor");
  const state = await table.words("state");
  return sensor.words.map((name, code) => {
    const rows = [...sensor.codes.keys()].filter((row) => sensor.codes[row] === code);
    const us = rows.map((row) => steps[row]! * run.clock.stepUs);
    const on = rows.map((row) => Number(["ON", "OPEN", "PRESENT"].includes((state.words[state.codes[row]!] ?? "").toUpperCase())));
    const stretches: Stretches = { from: us, to: us.map((_, i) => us[i + 1] ?? run.presentUs), value: on };
    const color = (value: number): string | null => (value ? "#44aa99" : null);
    return stretchLane(`${prefix}${name}/sensor`, name, name, stretches, color, (value) => (value ? "on" : "off"), 10);
  });
}
