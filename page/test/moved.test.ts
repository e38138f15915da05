/** Furniture that was moved, and rooms that robots keep out of. */

import { beforeAll, expect, test } from "vitest";
import type { ObjectFacts } from "../src/contract";
import type { EventRow } from "../src/data/events";
import { MovedObjects } from "../src/data/moved";
import type { Run } from "../src/data/run";
import { keptOut } from "../src/plan/kept_out";
import { wholeRun } from "./fixture";

const SOFA: ObjectFacts = { name: "sofa_1", type: "sofa", outline: [[0, 0], [2, 0], [2, 1], [0, 1]], middle: [1, 0.5], symbol: 0, blocks: "path", front: 0, uses: [] };
const moves = (...rows: [number, string][]): MovedObjects => new MovedObjects([SOFA], rows.map(([us, detail]) => ({ us, detail }) as EventRow));

test.each([
  [9, [1, 0.5]],
  [10, [4, 3]],
  [19, [4, 3]],
  [20, [-1, 0.25]],
])("at %d us the middle is at %j", (us, middle) => {
  expect(moves([10, "sofa_1 to (4, 3)"], [15, "piano to (9, 9)"], [20, "sofa_1 to (-1.0, 2.5e-1)"]).at(us)[0]!.middle).toEqual(middle);
});

test("the outline moves with the middle, and what was given stays", () => {
  expect(moves([10, "sofa_1 to (4, 3)"]).at(10)[0]!.outline).toEqual([[3, 2.5], [5, 2.5], [5, 3.5], [3, 3.5]]);
  expect(SOFA.outline[0]).toEqual([0, 0]);
});

let run: Run;
beforeAll(async () => {
  run = await wholeRun();
});

test("a robot keeps out of rooms by name and by kind, and of areas", () => {
  const { rooms } = run.facts.home;
  const area = [[0, 0], [1, 0], [1, 1]];
  const named = (room: string) => ({ room, area: null, during: [], passing: false, while: null });
  const keep_out = [named(rooms[0]!.name), named("bathroom"), { ...named(""), room: null, area }, named("cellar")];
  run.facts.scenario.robots = { astro: { keep_out } };
  const kept = keptOut(run, "astro");
  expect(kept.areas).toEqual([area]);
  expect(kept.rooms).toEqual([...rooms.keys()].filter((i) => i === 0 || rooms[i]!.type === "bathroom"));
  expect(keptOut(run, "nobody")).toEqual({ rooms: [], areas: [] });
});
