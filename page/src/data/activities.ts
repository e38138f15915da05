/** Kinds of activities, each with a colour: what a day is made of. */

export interface ActivityKind {
  name: string;
  color: string;
  activities: readonly string[];
}

export const KINDS: readonly ActivityKind[] = [
  { name: "Sleep", color: "#4c5788", activities: ["sleep", "nap"] },
  { name: "Care", color: "#74aeb8", activities: ["toilet", "wash_hands", "wash", "shower", "bath", "dress", "medication"] },
  { name: "Meals", color: "#cf8344", activities: ["drink", "breakfast", "cook", "dinner", "lunch", "snack", "dishes", "eat"] },
  { name: "Work, school", color: "#8a7ab5", activities: ["work_at_home", "homework", "computer", "study"] },
  { name: "Leisure", color: "#e8d38c", activities: ["read", "tv", "phone_call", "play", "rest", "phone", "hobby", "games", "music"] },
  { name: "Chores", color: "#b5957d", activities: ["fetch", "put_away", "tidy", "check_door", "laundry", "clean", "iron"] },
  { name: "Sport", color: "#2f6b55", activities: ["sport", "exercise"] },
];
export const OUT: ActivityKind = { name: "Out of home", color: "#e4e0d7", activities: [] };
export const OTHER: ActivityKind = { name: "Other", color: "#9aa3ad", activities: [] };

const kindOfActivity = new Map(KINDS.flatMap((kind) => kind.activities.map((activity) => [activity, kind] as const)));

export function kindOf(activity: string): ActivityKind {
  return kindOfActivity.get(activity) ?? OTHER;
}
