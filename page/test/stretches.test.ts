import { describe, expect, it } from "vitest";
import { Events } from "../src/data/events";
import { firstAtLeast, lastAtMost } from "../src/data/search";
import { differences, stretchesOf, timeByValue, valueAt } from "../src/data/stretches";

describe("search", () => {
  it("finds neighbors in sorted values, and says where there is none", () => {
    expect([lastAtMost([1, 3, 5], 4), lastAtMost([1, 3, 5], 0)]).toEqual([1, -1]);
    expect([firstAtLeast([1, 3, 5], 4), firstAtLeast([1, 3, 5], 9)]).toEqual([2, 3]);
  });
});

describe("stretches", () => {
  const a = stretchesOf([0, 10, 20], [1, 2, 1], 30);

  it("joins equal values", () => {
    expect(stretchesOf([0, 10, 20], [1, 1, 2], 30).from).toEqual([0, 20]);
  });

  it("knows the value at a moment, and that there is none after the end", () => {
    expect([valueAt(a, 9), valueAt(a, 10), valueAt(a, 30)]).toEqual([1, 2, null]);
  });

  it("shows where two lanes differ, adjoining parts as one", () => {
    const b = stretchesOf([0, 5, 10, 25], [1, 3, 4, 1], 30);
    expect(differences(a, b)).toEqual({ from: [5], to: [25], value: [1] });
  });

  it("sums up time until a moment", () => {
    expect([...timeByValue(a, 3, 25)]).toEqual([0, 15, 10, 0]);
  });
});

describe("events", () => {
  const events = new Events();
  [10, 20, 30].forEach((us, i) => events.add(us, us, "ana", i === 1 ? "left_home" : "activity", "", `${i}`));

  it("knows the last of an entity", () => {
    expect(events.last("ana", "activity", 25)?.detail).toBe("0");
    expect(events.last("ben", "activity", 25)).toBeNull();
  });
});
