/** How fast time passes, by what happens in a run. */

import { beforeAll, describe, expect, test } from "vitest";
import { type Pace, paceOf } from "../src/data/pace";
import type { Run } from "../src/data/run";
import { wholeRun } from "./fixture";

const CELL_US = 10e6;
let run: Run;
let pace: Pace;

beforeAll(async () => {
  run = await wholeRun();
  pace = paceOf(run);
});

/** Whether anybody moves within a stretch, found step by step. */
function moves(from: number, to: number): boolean {
  return run.bodies.some(({ name, robot }) => {
    if (robot) return false;
    const track = run.tracks.get(name)!;
    for (let us = from; us < to; us += 1e6) {
      const [one, other] = [track.poseAt(us), track.poseAt(us + 1e6)];
      if (one.x !== other.x || one.y !== other.y) return true;
    }
    return false;
  });
}

describe("the pace of a run", () => {
  test("no stretch in which people move is jumped over", () => {
    for (let us = 6 * 3600e6; us < 9 * 3600e6; us += CELL_US) {
      if (moves(us, us + CELL_US)) expect(pace.speedAt(us)).toBeLessThanOrEqual(80);
    }
  });

  test("time that passes in two parts is that which passes at once", () => {
    const at = 7 * 3600e6;
    expect(pace.after(pace.after(at, 0.7), 0.5)).toBeCloseTo(pace.after(at, 1.2), 0);
  });

  test("time within a dull stretch ends where something happens", () => {
    let at = 0;
    for (let frame = 0; frame < 2000; frame++) {
      const next = pace.after(at, 1 / 60);
      const speed = pace.speedAt(at);
      if (pace.speedAt(next) < speed) expect(next - Math.floor(next / CELL_US) * CELL_US).toBeLessThanOrEqual((pace.speedAt(next) * 1e6) / 60 + 1);
      at = next;
    }
  });

  test("time stops at the end of the run", () => {
    expect(pace.after(run.presentUs - 5e6, 1e6)).toBe(run.presentUs);
  });

  test("the liveliest morning is between six and eleven, and livelier than all others", () => {
    const at = pace.liveliest();
    const hour = run.clock.hourAt(at);
    expect(hour).toBeGreaterThanOrEqual(6);
    expect(hour).toBeLessThan(11);
    const most = pace.busy(at, at + 20 * 60e6);
    for (let us = 6 * 3600e6; us < 10 * 3600e6; us += 10 * 60e6) expect(pace.busy(us, us + 20 * 60e6)).toBeLessThanOrEqual(most);
  });
});
