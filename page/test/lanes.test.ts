import { describe, expect, it } from "vitest";
import type { MarkFacts } from "../src/contract";
import { lanesOf } from "../src/timeline/lanes";
import { wholeRun } from "./fixture";

const mark = (lane: string, step: number, end: number, kind: MarkFacts["kind"], label: string): MarkFacts => ({
  lane,
  step,
  end,
  kind,
  label,
});

describe("lanes of what was done and expected", async () => {
  const run = await wholeRun();
  run.facts.marks.push(
    mark("interventions", 60, 61, "intervention", "shut bath_door"),
    mark("quiet", 0, 100, "held", "quiet holds"),
    mark("quiet", 100, 160, "violated", "quiet is violated"),
    mark("quiet", 160, 86_400, "open", "quiet"),
  );
  const lanes = lanesOf(run, "0:", null);
  const words = (label: string, step: number): string =>
    lanes.find((lane) => lane.label === label)!.words(step * run.clock.stepUs);

  it("names an intervention from its step on", () => {
    expect([words("interventions", 59), words("interventions", 60)]).toEqual(["", "done: shut bath_door"]);
    expect(words("interventions", 5000)).toBe("done: shut bath_door");
  });

  it("says of an expectation when it held, was violated, or is not decided", () => {
    expect(words("quiet: expected", 99)).toBe("held: quiet holds");
    expect(words("quiet: expected", 100)).toBe("violated: quiet is violated");
    expect(words("quiet: expected", 200)).toBe("not decided: quiet");
  });

  it("is left out where nothing was done or expected", async () => {
    const other = await wholeRun();
    other.facts.marks.length = 0;
    expect(lanesOf(other, "0:", null).some((lane) => lane.id.endsWith("/marks"))).toBe(false);
  });
});

describe("lanes of requests", async () => {
  const run = await wholeRun();
  const robot = run.bodies.find((body) => body.robot)!.name;
  const happened: [step: number, event: string, detail: string][] = [
    [600, "due", "pill ana"],
    [900, "asks", "pill ana"],
    [905, "ignored", "pill ana"],
    [1500, "asks", "pill ana"],
    [1505, "accepted", "pill ana"],
    [2000, "due", "song ana"],
    [2300, "asks", "song ana"],
    [2305, "sent_away", "song ana kitchen_1"],
    [3000, "due", "song ana"],
    [3100, "asks", "song ana"],
    [3105, "deferred", "song ana"],
    [4000, "due", "song ana"],
    [4600, "expired", "song ana"],
    [5000, "due", "song ana"],
  ];
  for (const [step, event, detail] of happened) run.events.add(step, step * run.clock.stepUs, robot, event, "", detail);
  const lanes = lanesOf(run, "0:", null);
  const words = (text: string, step: number): string =>
    lanes.find((lane) => lane.label === `${run.label(robot)}: ${text}`)!.words(step * run.clock.stepUs);

  it("last from when a request came up to what came of it", () => {
    expect([599, 600, 1504, 1505].map((step) => words("pill ana", step))).toEqual(
      ["", "accepted after 15 min, asked 2 times", "accepted after 15 min, asked 2 times", ""],
    );
  });

  it("tell who was sent away, gave up, was too late, or still waits", () => {
    expect([2100, 2305, 3050, 3200, 4100, 5100].map((step) => words("song ana", step).split(/ after| for/)[0])).toEqual(
      ["sent away", "", "no answer", "", "expired", "open"],
    );
  });

  it("are left out where no robot wants anything", async () => {
    expect(lanesOf(await wholeRun(), "0:", null).some((lane) => lane.id.includes("/request/"))).toBe(false);
  });
});
