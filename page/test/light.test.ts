/** The light of the hour. */

import { beforeAll, expect, test } from "vitest";
import type { Run } from "../src/data/run";
import { skyAt } from "../src/plan/light";
import { wholeRun } from "./fixture";

const HOUR_US = 3600e6;
let run: Run;

beforeAll(async () => {
  Object.assign(globalThis, { document: { createElement: () => ({}) } });
  run = await wholeRun();
});

test("it is dark at night, light by day, and between them halfway at sunrise", () => {
  const [darkUntil, lightFrom] = run.facts.skies[0]!;
  expect(skyAt(run, 2 * HOUR_US).day).toBe(0);
  expect(skyAt(run, 12 * HOUR_US).day).toBe(1);
  expect(skyAt(run, ((darkUntil + lightFrom) / 2) * HOUR_US).day).toBeCloseTo(0.5);
});

test("the last day that is known holds for later ones", () => {
  expect(skyAt(run, 24 * HOUR_US + 12 * HOUR_US).day).toBe(1);
});
