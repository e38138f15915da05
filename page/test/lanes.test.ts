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
