import { beforeAll, describe, expect, it } from "vitest";
import { AWAY, roomOf } from "../src/data/rooms";
import type { Run } from "../src/data/run";
import { Walls } from "../src/data/sight";
import { differences, timeByValue, valueAt } from "../src/data/stretches";
import { TURN } from "../src/data/tracks";
import { Beliefs, makeDistribution, percents } from "../src/data/beliefs";
import * as state from "../src/state";
import { chosenBelief, comparisonAt, errorsOf } from "../src/plan/beliefs";
import { beliefLanes } from "../src/timeline/lanes";
import { expected, held, wholeRun } from "./fixture";

let run: Run;

beforeAll(async () => {
  run = await wholeRun();
});

describe("a stored run", () => {
  it("is read without a problem", () => {
    expect(run.problems.value).toEqual([]);
  });

  it.each(Object.keys(expected.poses))("has the poses of %s that Python rebuilds, to the last unit", (name) => {
    const track = run.tracks.get(name)!;
    const said = expected.poses[name]!;
    expected.steps.forEach((step, i) => {
      const pose = track.poseAt(step * run.clock.stepUs);
      expect(pose.x).toBe(run.home.units(said.x[i]!, 0));
      expect(pose.y).toBe(run.home.units(said.y[i]!, 1));
      expect(pose.heading).toBe(Math.round((said.heading[i]! * TURN) / (2 * Math.PI)) % TURN);
      expect(pose.away).toBe(said.away[i]);
    });
  });

  it.each(Object.keys(expected.poses))("has the rooms of %s at the steps and in the lane", (name) => {
    const track = run.tracks.get(name)!;
    expected.steps.forEach((step, i) => {
      const us = step * run.clock.stepUs;
      const room = expected.poses[name]!.room[i];
      expect(roomOf(track, run.home, us)).toBe(room);
      expect(valueAt(run.roomsOf(name), us)).toBe(room);
    });
  });

  it.each(Object.keys(expected.poses))("has the room of %s at every step in the lane", (name) => {
    const [track, lane] = [run.tracks.get(name)!, run.roomsOf(name)];
    for (let step = 0; step < run.clock.steps; step++) {
      const us = step * run.clock.stepUs;
      if (valueAt(lane, us) !== roomOf(track, run.home, us)) expect.fail(`another room at step ${step}`);
    }
  });

  it("has the visible regions that Python finds", () => {
    const walls = new Walls(held.walls[openWalls()]!);
    for (const region of expected.regions) {
      const outline = walls.outline(run.home.units(region.x, 0), run.home.units(region.y, 1));
      expect(areaOf(outline) / run.facts.home.units_per_m ** 2).toBeCloseTo(region.area, 9);
    }
  });

  it("sees nothing from inside a wall", () => {
    expect(new Walls(held.walls[0]!).outline(-50, -50)).toEqual([]);
  });

  it("finds observations at each step of a stretch in which somebody was noticed", async () => {
    const lane = run.sightings.find((entry) => entry.user === "ana")!;
    const step = lane.first[0]!;
    await run.observations!.load(step);
    expect(run.observations!.at(step)!.map((row) => row.user)).toContain("ana");
  });

  it("knows doors before and after they move", () => {
    const first = run.events.rows.find((row) => row.entity === "bath_door" && row.event === "shut")!;
    expect(run.doorOpen("bath_door", first.us - 1)).toBe(true);
    expect(run.doorOpen("bath_door", first.us)).toBe(false);
    expect(run.doorOpen("office_door", 0)).toBe(false);
  });

  it("compares beliefs with the share of time until now", () => {
    const comparison = comparisonAt(run, run.clock.endUs - 1)!;
    expect(sum(comparison.believed!)).toBeCloseTo(1, 9);
    expect(sum(comparison.truth!)).toBeCloseTo(1, 9);
    const time = timeByValue(run.roomsOf("ana"), run.facts.home.rooms.length, run.clock.endUs - 1);
    comparison.truth!.forEach((share, i) => expect(share).toBeCloseTo(time[i]! / (run.clock.endUs - 1), 9));
  });

  it.each(["ana", "anyone"])("has beliefs of %s that sum to one in each output, and truths at each moment", (user) => {
    state.belief.value = `ltp/${user}`;
    const { beliefs } = chosenBelief(run)!;
    const outputs = beliefs.of(user)!;
    expect(outputs.shares.length).toBeGreaterThan(2);
    expect(outputs.shares.some((shares) => shares.at(-1)! > 0.01)).toBe(true); // somebody was away
    for (const shares of outputs.shares) {
      expect(sum(shares)).toBeCloseTo(1, 9);
      expect(percents(shares).reduce((total, percent) => total + percent, 0)).toBe(100);
    }
    for (const hour of [1, 7, 13, 23]) expect(sum(comparisonAt(run, hour * 3600e6)!.truth!)).toBeCloseTo(1, 9);
    state.belief.value = "";
  });

  it("knows how wrong each output of shares was: the total variation to the shares until then", () => {
    const chosen = chosenBelief(run)!;
    const error = errorsOf(run, chosen);
    expect(error.us.length).toBeGreaterThan(2);
    error.us.forEach((us, i) => {
      const { believed, truth } = comparisonAt(run, us)!;
      const apart = believed!.reduce((sum, share, place) => sum + Math.abs(share - truth![place]!), 0) / 2;
      expect(error.values[i]).toBeCloseTo(apart, 9);
    });
  });

  it("judges beliefs of the present by the present room", () => {
    const { name } = chosenBelief(run)!.beliefs;
    const rooms = run.facts.home.rooms.length;
    const shares = new Float64Array(rooms + 1).fill(1 / (rooms + 1));
    const moments = [0, 3600e6, 7200e6];
    const series = new Map([["ana", { us: moments, shares: moments.map(() => shares) }]]);
    run.beliefs.unshift(new Beliefs("now", series, true));
    const comparison = comparisonAt(run, 7200e6)!;
    const room = valueAt(run.roomsOf("ana"), 7200e6)!;
    expect([comparison.algorithm, comparison.truth![room], [...comparison.now]]).toEqual(["now", 1, [room]]);
    for (const value of errorsOf(run, chosenBelief(run)!).values) expect(value).toBeCloseTo(rooms / (rooms + 1), 9);
    run.beliefs.shift();
    expect(chosenBelief(run)!.beliefs.name).toBe(name);
  });

  it("shows beliefs as a lane with the rooms that were believed or true, and the truth in words", () => {
    const [heat, error] = beliefLanes(run, "");
    const room = run.facts.home.rooms[valueAt(run.roomsOf("ana"), 20 * 3600e6)!]!.name;
    expect(heat!.words(20 * 3600e6)).toContain(`true: ${room}`);
    expect(heat!.paint().kind).toBe("heat");
    expect(error!.label).toContain("error");
    const [first, second] = chosenBelief(run)!.beliefs.of("ana")!.us;
    for (const lane of [heat!, error!]) {
      expect(lane.words(first! - 1)).toBe("");
      for (const us of [first!, second! - 1]) expect(lane.words(us)).toContain(`as of ${run.clock.text(first!)}`);
    }
  });

  it("is shown at steps, and between them only while time passes", () => {
    state.runs.value = [run];
    state.goTo(3600.7e6);
    expect(state.moment.value).toBe(3600e6);
    state.playing.value = true;
    state.goTo(3600.7e6);
    expect(state.moment.value).toBe(3600.7e6);
    state.playing.value = false;
  });

  it("reads its layers", async () => {
    const layer = await (await run.layer("explored.astro")).at(run.clock.steps);
    expect([layer!.low, layer!.high]).toEqual([0, 1]);
  });

  it("differs from itself nowhere", () => {
    expect(differences(run.roomsOf("ana"), run.roomsOf("ana")).from).toEqual([]);
  });

  it("counts all of its time", () => {
    const time = timeByValue(run.roomsOf("ana"), run.facts.home.rooms.length, run.clock.endUs);
    expect(time.reduce((sum, part) => sum + part, 0)).toBe(run.clock.endUs);
    expect(AWAY).toBe(-1);
  });
});

describe("shares", () => {
  it.each<[string, number[], number[] | null]>([
    ["of rooms at home beside that of away", [0.5, 0.5, 0.2], [0.4, 0.4, 0.2]],
    ["of rooms and away together", [0.5, 0.3, 0.2], [0.5, 0.3, 0.2]],
    ["of rooms alone", [0.5, 0.5, 0], [0.5, 0.5, 0]],
    ["that sum to something else", [0.9, 0.9, 0.1], null],
    ["that are none", [NaN, 1, 0], null],
  ])("%s sum to one, or aren't shown", (_, given, expected) => {
    const shares = Float64Array.from(given);
    expect(makeDistribution(shares)).toBe(expected !== null);
    if (expected) [...shares].forEach((share, i) => expect(share).toBeCloseTo(expected[i]!, 12));
  });

  it("are percents that sum to 100", () => {
    expect(percents(Float64Array.of(1 / 3, 1 / 3, 1 / 3))).toEqual([34, 33, 33]);
    expect(percents(Float64Array.of(0.005, 0.005, 0.99))).toEqual([1, 0, 99]);
    for (let n = 1; n < 60; n++) expect(percents(new Float64Array(n).fill(1 / n)).reduce((total, percent) => total + percent, 0)).toBe(100);
  });
});

function sum(values: Float64Array): number {
  return values.reduce((total, value) => total + value, 0);
}

/** The arrangement in which every door is open: the mesh with the fewest wall edges. */
function openWalls(): number {
  const walls = held.walls.map((entry) => entry.neighbors.filter((neighbor) => neighbor < 0).length);
  return walls.indexOf(Math.min(...walls));
}

function areaOf(outline: readonly number[]): number {
  let doubled = 0;
  for (let i = 0; i < outline.length; i += 2) {
    const k = (i + 2) % outline.length;
    doubled += outline[i]! * outline[k + 1]! - outline[k]! * outline[i + 1]!;
  }
  return doubled / 2;
}
