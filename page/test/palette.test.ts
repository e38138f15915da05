/** What the palette offers. */

import { beforeAll, expect, test } from "vitest";
import type { Run } from "../src/data/run";
import { answerItems, examplesOf, fits, itemsOf } from "../src/palette/items";
import { ask } from "../src/data/ask";
import * as state from "../src/state";
import { wholeRun } from "./fixture";

let run: Run;

beforeAll(async () => {
  run = await wholeRun();
  state.runs.value = [run];
});

const offered = (text: string): string[] => itemsOf(run, text, () => undefined).map(({ group, title }) => `${group}: ${title}`);

test("each example is understood", () => {
  expect(examplesOf(run).length).toBeGreaterThan(5);
  for (const example of examplesOf(run)) expect(ask(run, example, 0), example).toMatchObject({ isUnderstood: true });
});

test.each([
  ["day 1 06:30", "Go to: Mon 5 Jan 06:30:00"],
  ["dark", "Do: Light or dark"],
  ["where is ana", "Ask: where is ana"],
  ["pictur", "Do: Save a picture of this view (PNG)"],
  ["next fail", "Do: Next failure"],
])("Enter after '%s' does '%s', or says that it can't", (text, first) => {
  const isImpossible = first.includes("failure") && !run.facts.marks.some((mark) => mark.kind === "violated");
  if (!isImpossible) expect(offered(text)[0]).toBe(first);
  else expect(offered(text).join()).not.toContain(first);
});

test("a room is found by its label and by its name", () => {
  const [label] = run.home.labels;
  expect(offered(label!).join()).toContain(`Look at: ${label}`);
  expect(offered(run.facts.home.rooms[0]!.name).join()).toContain(`Look at: ${label}`);
});

test("a word that is nearly an action is offered as that action", () => {
  expect(offered("cleander").join()).toContain("Did you mean: Calendar or lanes");
});

test("each answer is an item with its moment and who it is about", () => {
  const answer = ask(run, "ana in bathroom", 0);
  const items = answerItems(run, answer);
  expect(items.map(({ us }) => us)).toEqual(answer.spans.slice(0, 24).map(({ from }) => from));
  expect(new Set(items.map(({ focus }) => focus))).toEqual(new Set(["ana"]));
});

test("all words of a text must begin a word", () => {
  expect(fits("Save a picture of this view (PNG)", "sa pic png")).toBe(true);
  expect(fits("Save a picture of this view (PNG)", "sa film")).toBe(false);
});
