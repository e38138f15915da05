/** How people are at a moment. */

import { expect, test } from "vitest";
import type { PostureFacts } from "../src/contract";
import { Postures } from "../src/data/postures";
import { held, wholeRun } from "./fixture";

const BED = { x: 1, y: 2, heading: 0, posture: "lie" };
const CHAIR = { x: 4, y: 2, heading: 1, posture: "sit" };
const FACTS: PostureFacts = { uses: [BED, CHAIR], user: ["ana", "ana", "ben"], use: [0, 1, 1], from_us: [0, 20, 5], to_us: [10, 30, 6] };

test.each([
  ["ana", 0, BED],
  ["ana", 9, BED],
  ["ana", 10, null],
  ["ana", 19, null],
  ["ana", 20, CHAIR],
  ["ana", 30, null],
  ["ben", 4, null],
  ["ben", 5, CHAIR],
  ["cleo", 5, null],
])("%s at %d us", (user, us, use) => {
  expect(new Postures(FACTS).at(user, us)).toEqual(use);
});

test("a stored run has the postures that Python found", async () => {
  const run = await wholeRun();
  const { from_us: from, use, user, uses } = held.postures;
  expect(from.length).toBeGreaterThan(3);
  from.forEach((us, i) => expect(run.postures!.at(user[i]!, us)).toEqual(uses[use[i]!]));
});
