/** Names as people write them. */

import type { RoomFacts } from "../contract";

/** A name with a capital letter, and spaces for underscores. */
export function title(name: string): string {
  const words = name.replaceAll("_", " ");
  return words.slice(0, 1).toUpperCase() + words.slice(1);
}

/** Bodies as people write them: with a capital letter, unless two would be written alike. */
export function bodyLabels(names: readonly string[]): Map<string, string> {
  const counts = new Map<string, number>();
  for (const name of names) counts.set(title(name), (counts.get(title(name)) ?? 0) + 1);
  return new Map(names.map((name) => [name, counts.get(title(name)) === 1 ? title(name) : name]));
}

/** Rooms as people write them: `bedroom_2` is "Bedroom 2", and "Bedroom" where it is the only one. */
export function roomLabels(rooms: readonly RoomFacts[]): string[] {
  const counts = new Map<string, number>();
  for (const { type } of rooms) counts.set(type, (counts.get(type) ?? 0) + 1);
  return rooms.map(({ name, type }) => {
    const number = name.startsWith(`${type}_`) ? Number(name.slice(type.length + 1)) : Number.NaN;
    if (!Number.isInteger(number)) return title(name);
    return counts.get(type) === 1 ? title(type) : `${title(type)} ${number}`;
  });
}

const DOES: Record<string, string> = {
  check_door: "Checking the door",
  clean: "Cleaning",
  computer: "At the computer",
  cook: "Cooking",
  dishes: "Washing up",
  dress: "Dressing",
  drink: "Having a drink",
  fetch: "Fetching something",
  freshen_up: "Freshening up",
  games: "Playing a game",
  outing: "Out",
  phone: "With the phone",
  phone_call: "On the phone",
  pick_up: "Picking something up",
  play: "Playing",
  put_away: "Putting away",
  read: "Reading",
  rest: "Resting",
  school: "At school",
  shower: "In the shower",
  sleep: "Asleep",
  tidy: "Tidying",
  toilet: "In the bathroom",
  tv: "Watching TV",
  wash: "Washing",
  wash_hands: "Washing hands",
  work: "At work",
  work_at_home: "Working",
};

/** What somebody does, in words. */
export function doing(activity: string): string {
  return DOES[activity] ?? title(activity);
}
