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
  const steps = new Set<number>([0]);
  const add = (us: number): void => {
    const step = Math.ceil(us / clock.stepUs);
    if (step < clock.steps) steps.add(step);
  };
  for (const us of track.stands()) add(us);
  for (const [from, to] of track.moves()) {
    for (let us = from; us <= to; us += clock.stepUs) add(us);
    add(to);
  }
  const ordered = Float64Array.from(steps).sort();
  const moments: number[] = [];
  const rooms: number[] = [];
  let last = Number.NaN;
  for (const step of ordered) {
    const room = roomOf(track, home, step * clock.stepUs);
    if (room === last) continue;
    moments.push(step * clock.stepUs);
    rooms.push(room);
    last = room;
  }
  return stretchesOf(moments, rooms, clock.endUs);
}
