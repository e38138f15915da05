/** Kinds of activities, each with a colour: what a day is made of. */

import { LOOK } from "../contract";

export interface ActivityKind {
  name: string;
  color: string;
  activities: readonly string[];
}

const KINDS: readonly ActivityKind[] = LOOK.activities;
export const OUT: ActivityKind = LOOK.out;
const OTHER: ActivityKind = LOOK.other;

const kindOfActivity = new Map(KINDS.flatMap((kind) => kind.activities.map((activity) => [activity, kind] as const)));

export function kindOf(activity: string): ActivityKind {
  return kindOfActivity.get(activity) ?? OTHER;
}
