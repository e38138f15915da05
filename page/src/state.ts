/** The state of the page: signals that all parts read, and the few functions that change them. */

import type { EventKind } from "./contract";
import { batch, computed, signal } from "@preact/signals";
import { type Answer, ask, withWords } from "./data/ask";
import type { EventRow } from "./data/events";
import type { Run } from "./data/run";
import { firstAtLeast, lastAtMost } from "./data/search";

export const SPEEDS = [1, 10, 60, 600, 3600, 14_400, 86_400];
/** The speed that follows what happens: dull time flies. */
export const ADAPTIVE = 0;
export const SWITCHES = ["names", "furniture", "ways", "sight", "observations", "beliefs", "lights", "slows"] as const;
export type Switch = (typeof SWITCHES)[number];
export const PANELS = ["now", "inspect", "beliefs", "events", "metrics", "layers", "notes"] as const;
export type Panel = (typeof PANELS)[number];
export type Theme = "auto" | "light" | "dark";

export const runs = signal<Run[]>([]);
/** The moment that is shown [us since the start]. */
export const moment = signal(0);
/** The moment that words are about [us]: it follows the moment that is shown, but only several times a second. */
export const told = signal(0);
/** The part of the run that the timeline shows [us]. */
export const range = signal<[number, number]>([0, 1]);
/** A range whose totals are shown [us]. */
export const marked = signal<[number, number] | null>(null);
export const playing = signal(false);
export const speed = signal(ADAPTIVE);
/** How the timeline shows the run: a row a day, or a lane for each body. */
export const view = signal<"calendar" | "lanes">("calendar");
/** Goes up by one whenever plans shall show the whole home. */
export const fits = signal(0);
export const selected = signal("");
/** The body that the plan follows; empty: none. */
export const followed = signal("");
/** A column that is plotted beside the metrics, as "table.column". */
export const plot = signal("");
export const eventKind = signal("");
export const search = signal("");
/** What was asked of the timeline, and the moment that was shown then. */
export const question = signal<{ text: string; nearUs: number } | null>(null);
export const shown = signal<ReadonlySet<Switch>>(new Set(SWITCHES.filter((name) => name !== "beliefs")));
export const layer = signal("");
export const panel = signal<Panel>("now");
export const belief = signal("");
export const theme = signal<Theme>("auto");
export const live = signal(false);
export const follow = signal(true);

export const run = computed<Run | null>(() => runs.value[0] ?? null);
const chosenRun = signal<Run | null>(null);
/** The run that is inspected: the one on whose plan somebody clicked last. */
export const inspected = computed<Run | null>(() => (chosenRun.value && runs.value.includes(chosenRun.value) ? chosenRun.value : run.value));
/** The part of the runs that can be shown [us]. */
export const beginUs = computed(() => Math.min(...runs.value.map((entry) => entry.beginUs)));
export const endUs = computed(() => Math.max(1, ...runs.value.map((entry) => (entry.version.value, entry.endUs))));

/** The events of the chosen kind that have the words that are searched for. */
export const foundEvents = computed<readonly EventRow[]>(() => {
  const entry = run.value;
  if (!entry) return [];
  void entry.version.value;
  const [kind, words] = [eventKind.value, search.value.trim()];
  const rows = kind ? entry.events.ofKind(kind as EventKind) : entry.events.rows;
  return words ? withWords(entry, rows, words) : rows;
});

/** What answers the question, as far as the run is read or simulated. */
export const answer = computed<Answer | null>(() => {
  const [entry, other = null] = runs.value;
  if (!entry || !question.value) return null;
  void [entry.version.value, other?.version.value];
  return ask(entry, question.value.text, question.value.nearUs, other);
});

/** Their moments. */
export const foundTimes = computed<readonly number[]>(() => foundEvents.value.map((row) => row.us));

const SHORTEST_US = 10e6;
/** Words change at most this often [ms] while time passes, and while somebody scrubs: nobody reads faster. */
const TOLD_MS = 200;
const SCRUBBED_MS = 60;
let toldAt = 0;
let toldLater: ReturnType<typeof setTimeout> | undefined;

/** Let words be about the moment that is shown, so many milliseconds after they changed. */
function tell(after: number): void {
  clearTimeout(toldLater);
  const wait = toldAt + after - performance.now();
  if (wait > 0) {
    toldLater = setTimeout(() => tell(0), wait);
    return;
  }
  told.value = moment.peek();
  toldAt = performance.now();
}

/**
 * Show a moment everywhere. While time passes it may lie between two steps; else it is that of a step, so that what
 * is shown is what the run stored.
 */
export function goTo(us: number, isScrubbing = false): void {
  const end = endUs.value;
  const stepUs = run.value?.clock.stepUs ?? 1;
  const last = Math.max(beginUs.value, end - stepUs);
  const inside = Math.max(beginUs.value, Math.min(last, us));
  const at = playing.value ? inside : Math.floor(inside / stepUs) * stepUs;
  batch(() => {
    moment.value = at;
    tell(playing.value ? TOLD_MS : isScrubbing ? SCRUBBED_MS : 0);
    const [from, to] = range.value;
    if (at < from || at > to) setRange(at - (to - from) / 2, at + (to - from) / 2);
  });
}

/** Ranges that were shown before, the last one at the end. */
const ranges: [number, number][] = [];
const MOST_RANGES = 50;
const SAME_GESTURE_MS = 600;
let zoomedAt = 0;

/** Remember the range before a zoom; the steps of one gesture are one. */
function remember(): void {
  const now = performance.now();
  if (now - zoomedAt > SAME_GESTURE_MS) ranges.push(range.value);
  zoomedAt = now;
  if (ranges.length > MOST_RANGES) ranges.shift();
}

/** Show the range before the last zoom again. */
export function zoomBack(): void {
  const before = ranges.pop();
  if (before) range.value = before;
}

/** Show a range, which `zoomBack` undoes. */
export function showRange(from: number, to: number): void {
  remember();
  setRange(from, to);
}

export function setRange(from: number, to: number): void {
  const [begin, end] = [beginUs.value, endUs.value];
  const total = end - begin;
  const length = Math.max(Math.min(SHORTEST_US, total), Math.min(total, to - from));
  const start = Math.max(begin, Math.min(end - length, from));
  range.value = [start, start + length];
}

/** Zoom about a moment: a factor below 1 shows less. */
export function zoom(factor: number, about = moment.value): void {
  const [from, to] = range.value;
  showRange(about - (about - from) * factor, about + (to - about) * factor);
}

export function pan(us: number): void {
  const [from, to] = range.value;
  setRange(from + us, to + us);
}

export function toggle(name: Switch): void {
  const switches = new Set(shown.value);
  if (!switches.delete(name)) switches.add(name);
  shown.value = switches;
}

export function faster(by: 1 | -1): void {
  const from = speed.value === ADAPTIVE ? 60 : speed.value;
  const at = SPEEDS.findIndex((entry) => entry >= from);
  const next = SPEEDS[Math.max(0, Math.min(SPEEDS.length - 1, (at < 0 ? SPEEDS.length : at) + by))];
  speed.value = next ?? speed.value;
}

/** Go to the next answer, or without a question to the next event; or to the one before. */
export function jump(forward: boolean): void {
  const moments = answer.value?.spans.map((span) => span.from) ?? foundTimes.value;
  const at = forward ? lastAtMost(moments, moment.value) + 1 : firstAtLeast(moments, moment.value) - 1;
  const us = moments[at];
  if (us !== undefined) goTo(us);
}

/** Select a body, a door or a room; of two runs, in the one that was clicked. */
export function select(name: string, of: Run | null = null): void {
  batch(() => {
    if (of) chosenRun.value = of;
    selected.value = name;
    if (name) panel.value = "inspect";
  });
}
