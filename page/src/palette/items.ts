/** What the palette offers for a text: a question, moments, things, cards of the story, actions. */

import { type Action, keyText, possibleActions } from "../actions";
import { type Answer, ask, EXAMPLES } from "../data/ask";
import { durationText } from "../data/clock";
import { distance, normal } from "../data/names";
import type { Run } from "../data/run";
import { title } from "../data/words";
import * as state from "../state";

export interface Item {
  key: string;
  group: "Ask" | "Answers" | "Go to" | "Look at" | "Story" | "Do" | "Did you mean";
  title: string;
  hint: string;
  /** The moment that a picture beside it shows, and the body in its middle; null: no picture. */
  us: number | null;
  focus: string;
  run: () => void;
  /** Whether the palette stays open when it is chosen. */
  stays?: boolean;
}

const MOST_OF_A_GROUP = 7;
const MOST_ANSWERS = 24;

/** The question of a text, and its answer as far as it is known. */
export function askItem(text: string, put: (text: string) => void): Item {
  return { key: "ask", group: "Ask", title: text, hint: "Enter", us: null, focus: "", run: () => put(text), stays: true };
}

/** The stretches of an answer, in the order of time. */
export function answerItems(run: Run, answer: Answer): Item[] {
  const { clock } = run;
  const shown = answer.spans.slice(0, MOST_ANSWERS);
  return shown.map((span, i) => ({
    key: `answer-${i}`,
    group: "Answers",
    title: span.words || answer.question,
    hint: [clock.text(span.from).slice(0, -3), span.to > span.from ? durationText(span.to - span.from) : ""].filter(Boolean).join(" · "),
    us: span.from,
    focus: run.bodies.find((body) => span.words.includes(run.label(body.name)))?.name ?? "",
    run: () => state.goTo(span.from),
    stays: true,
  }));
}

/** Questions that can be asked of this run, with its names. */
export function examplesOf(run: Run): string[] {
  const people = run.bodies.filter((body) => !body.robot);
  const { rooms } = run.facts.home;
  if (people.length === 0 || rooms.length === 0) return [];
  const room = rooms.find(({ type }) => type === "kitchen") ?? rooms[0]!;
  return EXAMPLES.map((example, i) => example.replace("NAME", people[i % people.length]!.name).replace("ROOM", room.type.replaceAll("_", " ")));
}

/** Everything that fits a text, the first one is what Enter does. */
export function itemsOf(run: Run, text: string, put: (text: string) => void): Item[] {
  const words = text.trim();
  if (!words) return [...examplesOf(run).slice(0, 5).map((example, i) => ({ ...askItem(example, put), key: `example-${i}`, hint: "" })), ...storyItems(run), ...actionItems("")];
  const others = [...timeItems(run, words), ...thingItems(run, words), ...storyItems(run).filter(({ title: name }) => fits(name, words)), ...actionItems(words)];
  const answer = ask(run, words, state.moment.value, state.runs.value[1] ?? null);
  const question = { ...askItem(words, put), hint: answer.isUnderstood ? answer.words : "" };
  if (answer.isUnderstood) return [question, ...others];
  if (others.length > 0) return others;
  const failed = { ...question, hint: answer.words };
  if (answer.meant) return [failed, { ...askItem(answer.meant, put), key: "meant", group: "Did you mean" as const, hint: "" }];
  return [failed, ...nearest(words)];
}

function timeItems(run: Run, text: string): Item[] {
  const us = run.clock.parse(text, state.moment.value);
  if (us === null) return [];
  return [{ key: "time", group: "Go to", title: run.clock.text(us), hint: "", us, focus: "", run: () => state.goTo(us) }];
}

function thingItems(run: Run, text: string): Item[] {
  const { rooms, doors, objects } = run.facts.home;
  const us = state.moment.value;
  const things: [string, string, string][] = [
    ...run.bodies.map(({ name, robot }) => [name, run.label(name), robot ? "robot" : "person"] as [string, string, string]),
    ...rooms.map(({ name, type }, i) => [name, run.home.labels[i]!, title(type)] as [string, string, string]),
    ...doors.map(({ name }) => [name, title(name), "door"] as [string, string, string]),
    ...objects.map(({ name, type }) => [name, title(name), title(type)] as [string, string, string]),
  ];
  const fitting = things.filter(([name, label]) => fits(label, text) || normal(name) === normal(text));
  return fitting.slice(0, MOST_OF_A_GROUP).map(([name, label, hint]) => ({
    key: `thing-${name}`,
    group: "Look at",
    title: label,
    hint,
    us: run.body(name) ? us : null,
    focus: name,
    run: () => state.select(name),
  }));
}

function storyItems(run: Run): Item[] {
  return run.facts.story.map(({ step, title: name, words, who }) => ({
    key: `story-${step}-${name}`,
    group: "Story",
    title: name,
    hint: words,
    us: step * run.clock.stepUs,
    focus: who[0] ?? "",
    run: () => state.goTo(step * run.clock.stepUs),
  }));
}

function actionItem({ title: name, key, run }: Action): Item {
  return { key: `do-${name}`, group: "Do", title: name, hint: keyText(key), us: null, focus: "", run };
}

function actionItems(text: string): Item[] {
  return possibleActions()
    .filter(({ title: name }) => fits(name, text))
    .slice(0, MOST_OF_A_GROUP)
    .map(actionItem);
}

/** Actions that may be meant by a text which fits nothing. */
function nearest(text: string): Item[] {
  const words = normal(text).split(" ");
  const far = (name: string): number => {
    const others = normal(name).split(" ");
    return words.reduce((sum, word) => sum + Math.min(...others.map((other) => distance(word, other) / Math.max(2, word.length))), 0) / words.length;
  };
  return possibleActions()
    .map((action) => [far(action.title), action] as const)
    .filter(([share]) => share < 0.5)
    .sort(([one], [other]) => one - other)
    .slice(0, 3)
    .map(([, action]) => ({ ...actionItem(action), group: "Did you mean" }));
}

/** Whether each word of a text begins a word of a title. */
export function fits(name: string, text: string): boolean {
  const parts = normal(name).split(/[\s(),:]+/);
  return normal(text)
    .split(" ")
    .every((word) => parts.some((part) => part.startsWith(word)));
}
