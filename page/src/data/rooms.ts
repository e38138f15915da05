/** Which room a body is in at each step of a run. */

import type { Clock } from "./clock";
import type { Home } from "./home";
import { type Stretches, stretchesOf } from "./stretches";
import type { Track } from "./tracks";

export const AWAY = -1;

/** The room at a moment, -1 while away. */
export function roomOf(track: Track, home: Home, us: number): number {
  const pose = track.poseAt(us);
  return pose.away ? AWAY : home.roomAt(pose.x, pose.y);
}

/**
 * The rooms of a body as stretches. It is looked up where the body begins to stand, and at each step
 * while it moves, so that the room at each step is the run's own.
 */
export function roomStretches(track: Track, home: Home, clock: Clock): Stretches {
  if (track.empty) return { from: [], to: [], value: [] };
  const moments: number[] = [];
  const rooms: number[] = [];
  let last = Number.NaN;
  track.follow(stepsOfChange(track, clock), clock.stepUs, (step, x, y, away) => {
    const room = away ? AWAY : home.roomAt(x, y);
    if (room === last) return;
    moments.push(step * clock.stepUs);
    rooms.push(room);
    last = room;
  });
  return stretchesOf(moments, rooms, clock.endUs);
}

/** The steps at which the body may come to another room, in order. */
function stepsOfChange(track: Track, { stepUs, steps }: Clock): number[] {
  const found = [0];
  let last = 0;
  for (const [from, to] of track.changes()) {
    const end = Math.min(steps - 1, Math.ceil(to / stepUs));
    for (let step = Math.max(last + 1, Math.ceil(from / stepUs)); step <= end; step++) found.push((last = step));
  }
  return found;
}
