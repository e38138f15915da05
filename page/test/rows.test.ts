import { afterEach, describe, expect, it } from "vitest";
import { snapped } from "../src/timeline/pointer";
import { levelOf, mergedStretches } from "../src/timeline/levels";
import type { Lane } from "../src/timeline/lanes";
import { visibleRows } from "../src/timeline/draw";
import { change, filter, hidden, pinned, rowsOf, toggled } from "../src/timeline/rows";

const lane = (subject: string, what: string, group: Lane["group"] = "Users"): Lane => ({
  id: `${subject}/${what}`,
  label: what === "room" ? subject : `${subject} ${what}`,
  subject,
  group,
  height: 20,
  isMain: what === "room",
  words: () => "",
  paint: () => ({ kind: "ticks", us: [1e6, 50e6], color: "#000000" }),
});

const few = ["ana", "ben"].flatMap((name) => [lane(name, "room"), lane(name, "does")]);
const crowd = Array.from({ length: 50 }, (_, i) => `u${i}`).flatMap((name) => [lane(name, "room"), lane(name, "does")]);
const labels = (lanes: Lane[]): string[] => rowsOf(lanes).map((row) => row.label);

describe("rows of the timeline", () => {
  afterEach(() => {
    for (const set of [toggled, pinned, hidden]) set.value = new Set();
    filter.value = "";
  });

  it("shows all lanes of few bodies, and one of each of many", () => {
    expect(labels(few)).toEqual(["Users (2)", "ana", "ana does", "ben", "ben does"]);
    expect(labels(crowd)).toHaveLength(51);
  });

  it("folds and unfolds groups and bodies", () => {
    change(toggled, "Users/u3");
    expect(labels(crowd).slice(3, 6)).toEqual(["u2", "u3", "u3 does"]);
    change(toggled, "Users");
    expect(labels(crowd)).toEqual(["Users (50)"]);
  });

  it("finds lanes by their text, also folded ones", () => {
    filter.value = "u7 D";
    expect(labels(crowd)).toEqual(["Users (1)", "u7 does"]);
  });

  it("keeps pinned lanes at the top of a scrolled view, and hides others", () => {
    change(pinned, "u40/room");
    change(hidden, "u0/room");
    const rows = visibleRows(rowsOf(crowd), 200, 300);
    expect(rows.map((row) => [row.label, row.top]).slice(0, 2)).toEqual([["u40", 34], ["u7", 39]]);
    expect(rows.every((row) => row.top < 300)).toBe(true);
  });
});

describe("levels of detail", () => {
  const stretches = { from: [0, 7e6, 8e6, 31e6], to: [7e6, 8e6, 30e6, 40e6], value: [1, 2, 1, 3] };

  it("merge what is short into what lasts longest", () => {
    expect(mergedStretches(stretches, 4e6)).toEqual({ from: [0, 32e6], to: [32e6, 40e6], value: [1, 3] });
  });

  it("keep what has the highest rank", () => {
    const merged = mergedStretches(stretches, 4e6, (value) => (value === 2 ? 1 : 0));
    expect([merged.from, merged.to, merged.value]).toEqual([[0, 4e6, 8e6, 32e6], [4e6, 8e6, 32e6, 40e6], [1, 2, 1, 3]]);
  });

  it("are computed once for a scale, and anew when a live run has grown", () => {
    const from = Array.from({ length: 3000 }, (_, i) => i * 1e6);
    const long = { from, to: from.map((us) => us + 1e6), value: from.map((_, i) => i % 2) };
    expect(levelOf(long, 1e6)).toBe(long);
    const level = levelOf(long, 60e6);
    expect(level.from.length).toBeLessThan(200);
    expect(levelOf(long, 50e6)).toBe(level);
    long.from.push(3000e6);
    long.to.push(3001e6);
    long.value.push(0);
    expect(levelOf(long, 60e6).to.at(-1)!).toBeGreaterThanOrEqual(3001e6);
  });
});

describe("a click", () => {
  it("goes to the event beside it, and elsewhere to where it is", () => {
    const row = visibleRows(rowsOf([lane("ana", "room")]), 0, 300)[1]!;
    const scale = { from: 0, to: 100e6, width: 100 };
    expect([48e6, 52e6, 20e6].map((us) => snapped(row, us, scale))).toEqual([50e6, 50e6, 20e6]);
  });
});
