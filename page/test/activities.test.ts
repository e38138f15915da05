import { expect, test } from "vitest";
import { LOOK } from "../src/contract";
import { iconOf, kindOf } from "../src/data/activities";

test("every activity of a kind has an icon, and others have a dot", () => {
  const activities = LOOK.activities.flatMap(({ activities: of }) => [...of]);
  expect(activities.filter((activity) => iconOf(activity) === "dot")).toEqual([]);
  expect(iconOf("juggling")).toBe("dot");
});

test("what people of the bundled homes do by habit has a kind", () => {
  for (const activity of ["pick_up", "freshen_up"]) expect(kindOf(activity)).not.toBe(kindOf("juggling"));
});
