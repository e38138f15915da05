/** Kinds of activities, each with a colour: what a day is made of. */

import { LOOK } from "../contract";
import type { IconName } from "../Icon";

export interface ActivityKind {
  name: string;
  color: string;
  activities: readonly string[];
}

const KINDS: readonly ActivityKind[] = LOOK.activities;
export const OUT: ActivityKind = LOOK.out;
const OTHER: ActivityKind = LOOK.other;

const kindOfActivity = new Map(KINDS.flatMap((kind) => kind.activities.map((activity) => [activity, kind] as const)));

/** An icon for each kind; some activities have their own. */
const ICONS: Readonly<Record<string, IconName>> = {
  Sleep: "moon",
  Care: "drop",
  Meals: "cup",
  "Work, school": "laptop",
  Leisure: "book",
  Chores: "box",
  Sport: "bell",
  tv: "tv",
  shower: "shower",
  cook: "pan",
  dishes: "pan",
  phone: "phone",
  phone_call: "phone",
  lunch: "fork",
  dinner: "fork",
  play: "ball",
  games: "ball",
  rest: "sofa",
  dress: "shirt",
};

export function iconOf(activity: string): IconName {
  return ICONS[activity] ?? ICONS[kindOf(activity).name] ?? "dot";
}

export function kindOf(activity: string): ActivityKind {
  return kindOfActivity.get(activity) ?? OTHER;
}
