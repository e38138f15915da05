/** Names as people write them. */

import { describe, expect, test } from "vitest";
import { doing, roomLabels, title } from "../src/data/words";

const room = (name: string, type: string) => ({ name, type, color: "", deep_color: "", anchor: [0, 0] as [number, number], area_m2: 1 });

describe("names of rooms", () => {
  test("the only room of a type has no number", () => {
    expect(roomLabels([room("kitchen_1", "kitchen")])).toEqual(["Kitchen"]);
  });

  test("others keep the number by which all else names them", () => {
    expect(roomLabels([room("bedroom_1", "bedroom"), room("bedroom_2", "bedroom")])).toEqual(["Bedroom 1", "Bedroom 2"]);
  });

  test("names that somebody gave stay as they are", () => {
    expect(roomLabels([room("Mia's room", "bedroom"), room("müller_zimmer", "bedroom")])).toEqual(["Mia's room", "Müller zimmer"]);
  });
});

test("an activity without words of its own is named as it is", () => {
  expect([doing("tv"), doing("water_plants")]).toEqual(["Watching TV", "Water plants"]);
});

test("a name without letters is kept", () => {
  expect(title("")).toBe("");
});
