import { describe, expect, it } from "vitest";
import { ask, withWords } from "../src/data/ask";
import type { Run } from "../src/data/run";
import { wholeRun } from "./fixture";

const HOUR = 3600e6;

/** Four hours of people in two rooms, K and B, or away, A, and what robots saw of them. */
async function home(rooms: Record<string, string>, seen: [robot: string, user: string, from: number, to: number][] = []): Promise<Run> {
  const run = await wholeRun();
  const robots = [...new Set(seen.map(([robot]) => robot))];
  const body = run.bodies[0]!;
  const named = (name: string, robot: boolean) => ({ ...body, name, robot });
  run.facts.bodies = [...Object.keys(rooms).map((name) => named(name, false)), ...robots.map((name) => named(name, true))];
  run.facts.home = { ...run.facts.home, rooms: ["K", "B"].map((name, i) => ({ ...run.facts.home.rooms[i]!, name: name === "K" ? "kitchen_1" : "in", type: name === "K" ? "kitchen" : "bath_room" })) };
  Object.assign(run.home, { facts: run.facts.home });
  Object.assign(run.facts, { end_step: 4 * 3600 });
  run.rooms.clear();
  for (const [name, hours] of [...Object.entries(rooms), ...robots.map((robot) => [robot, "AAAA"] as const)]) {
    run.rooms.set(name, { from: [...hours].map((_, i) => i * HOUR), to: [...hours].map((_, i) => (i + 1) * HOUR), value: [...hours].map((letter) => "KB".indexOf(letter)) });
  }
  run.sightings = seen.map(([robot, user, from, to]) => ({ robot, user, first: [from * 3600], last: [to * 3600 - 1], false: [false] }));
  run.events = new (run.events.constructor as new () => Run["events"])();
  return run;
}

const hours = (run: Run, question: string): number[][] => ask(run, question, 0).spans.map((span) => [span.from / HOUR, span.to / HOUR]);

describe("names", async () => {
  const run = await home({ ann: "KKBA", anna: "BBKK", ann_lee: "KBKB", Bob: "KAAA", bob: "AKAA", seen: "KKAA", in: "AAKK", last: "BKBK", "x-1": "KBBB" }, [
    ["r2", "ann", 0, 2],
    ["r2", "seen", 2, 3],
    ["by", "ann", 1, 3],
    ["by", "anna", 3, 4],
  ]);

  it.each<[string, number[][]]>([
    ["ann in kitchen", [[0, 2]]],
    ["anna in kitchen", [[2, 4]]],
    ["ann lee in kitchen", [[0, 1], [2, 3]]],
    ["ANN_LEE in Kitchen", [[0, 1], [2, 3]]],
    ["x-1 in kitchen_1", [[0, 1]]],
    ["Bob in kitchen", [[0, 1]]],
    ["bob in kitchen", [[1, 2]]],
    ["seen in kitchen", [[0, 2]]],
    ["in in kitchen", [[2, 4]]],
    ["ann in in", [[2, 3]]],
    ["in not in in", [[0, 4]]],
    ["ann in bath room", [[2, 3]]],
    ['"last" in kitchen', [[1, 2], [3, 4]]],
    ["last last in kitchen", [[3, 4]]],
    ["last seen seen", [[2, 3]]],
    ["seen ann by by", [[1, 3]]],
    ["by sees ann", [[1, 3]]],
    ['"seen" away', [[2, 4]]],
  ])("are whole in '%s'", (question, expected) => {
    expect(hours(run, question)).toEqual(expected);
  });

  it.each<[string, number[][]]>([
    ["ann and seen in kitchen", [[0, 2]]],
    ["ann, seen and x-1 in kitchen", [[0, 1]]],
    ["ann anna in kitchen", []],
    ["ann or anna in kitchen", [[0, 4]]],
    ["ann and anna not in kitchen", []],
    ["ann or anna not in kitchen", [[0, 4]]],
    ["ann in kitchen or in", [[0, 3]]],
    ["ann home", [[0, 3]]],
    ["seen ann", [[0, 3]]],
    ["ann not seen", [[3, 4]]],
    ["seen ann by r2 and by", [[1, 2]]],
    ["seen ann by r2 or by", [[0, 3]]],
    ["seen ann and anna", []],
    ["seen by by", [[1, 4]]],
    ["ann in kitchen after 1 h", [[1, 2]]],
    ["ann in kitchen > 90 min until 1 h", [[0, 1]]],
    ["not seen ann before 4 h", [[3, 4]]],
  ])("of several are joined in '%s'", (question, expected) => {
    expect(hours(run, question)).toEqual(expected);
  });

  it("that differ only in capitals are told apart by them, or not at all", () => {
    expect(ask(run, "BOB in kitchen", 0).words).toBe("'BOB' may be Bob or bob: write it with the same capitals");
  });

  it("of an answer at a moment are those of whoever is there", () => {
    expect(ask(run, "kitchen at 0:30", 0).words).toContain("Ann, Ann lee, Bob, Seen, X-1");
    expect(ask(run, "in at 0:30", 0).words).toContain("In is out of home"); // somebody before a room
    expect(ask(run, "ann and seen in kitchen at 0:30", 0).words).toMatch(/: yes$/);
    expect(ask(run, "ann in kitchen at 3:30", 0).words).toMatch(/: no$/);
  });
});

describe("events", async () => {
  const run = await home({ ann: "KKBA", anna: "BBKK", ann_lee: "KBKB" }, [["r2", "ann", 0, 1]]);
  const add = (at: number, entity: string, event: string, user = "", detail = ""): void => run.events.add(at, at * 1e6, entity, event, user, detail);
  add(0, "ann", "activity", "", "sleep");
  add(5, "anna", "activity", "", "sleep");
  add(9, "ann_lee", "activity", "", "sleep_in");
  add(10, "r2", "way_blocked", "", "bath_room");
  add(12, "r2", "user_seen", "ann");
  add(20, "r2", "asks", "", "tea ann_lee");
  add(80, "ann", "activity", "", "evening_walk");

  const froms = (question: string): number[] => ask(run, question, 0).spans.map((span) => span.from / 1e6);

  it.each([
    ["ann sleep", [0]],
    ["anna sleep", [5]],
    ["ann lee sleep", [9]],
    ["sleep in", [9]],
    ["user seen", [12]],
    ["r2 user seen ann", [12]],
    ["asks ann lee", [20]],
    ["asks ann", []],
    ["ann evening walk", [80]],
    ["r2 way blocked", [10]],
    ["r2 way blocked > 9 s", [10]],
    ["r2 way blocked > 10 s", []],
    ["mornings r2 asks", []],
  ])("have whole words in '%s'", (question, expected) => {
    expect(froms(question)).toEqual(expected);
  });

  it("that are moments make the part of a day in which they happen", () => {
    expect(ask(run, "nights user seen", 0).words).toBe("1 night");
  });

  it("are told to be moments if their length is asked for", () => {
    expect(ask(run, "user seen > 1 s", 0).words).toBe("these events are moments: they have no length");
  });

  it("of a kind that the run has none of happen never", () => {
    expect(ask(run, "r2 gave up", 0).words).toContain("never");
    expect(ask(run, "r2 dances", 0).words).toContain("is called 'dances'");
  });

  it("are found by whole words in the box of events, too", () => {
    expect(withWords(run, run.events.rows, "ann").map((row) => row.step)).toEqual([0, 12, 80]);
    expect(withWords(run, run.events.rows, "ann_lee").map((row) => row.step)).toEqual([9, 20]);
  });
});

describe("a part of a run", async () => {
  const run = await home({ ann: "KKBA" });
  Object.assign(run.facts, { first_step: 3600, end_step: 3 * 3600 });

  it("is asked within its ends", () => {
    expect(hours(run, "ann in kitchen")).toEqual([[1, 2]]);
    expect(hours(run, "ann not in kitchen")).toEqual([[2, 3]]);
  });
});

describe("what a run doesn't know", async () => {
  const run = await home({ ann: "KKBA" });

  it("is told instead of never", () => {
    run.facts.tables = run.facts.tables.filter((table) => table.name !== "observations");
    expect(ask(run, "seen ann", 0).words).toBe("the run stored no observations: nobody knows who was seen");
    run.rooms.clear();
    run.tracks.clear();
    expect(ask(run, "ann in kitchen", 0).words).toContain("the run stored no key frames");
    run.isRead.value = false;
    expect(ask(run, "seen ann", 0).words).toBe("the run is still being read");
  });
});
