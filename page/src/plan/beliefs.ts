/** What an algorithm believes, on the plan: a disc in each room, beside a ring for what is true. */

import { AWAY } from "../data/rooms";
import type { Run } from "../data/run";
import { timeByValue, valueAt } from "../data/stretches";
import { belief } from "../state";
import { bodyColor, colors } from "../theme";
import type { Frame } from "./frame";

const FULL_M = 0.9;

export interface Comparison {
  user: string;
  algorithm: string;
  /** Share per room as believed, and as it was up to now; the last is away. */
  believed: Float64Array;
  truth: Float64Array;
  /** Where the user is now: index of the room, the number of rooms for away. */
  now: number;
  sinceUs: number;
}

/** Beliefs that can be shown: "algorithm/user". */
export function beliefNames(run: Run): string[] {
  return run.beliefs.flatMap((entry) => entry.users.map((user) => `${entry.name}/${user}`));
}

export function comparisonAt(run: Run, us: number): Comparison | null {
  const names = beliefNames(run);
  const name = names.includes(belief.value) ? belief.value : names[0];
  if (!name) return null;
  const [algorithm, user] = [name.slice(0, name.indexOf("/")), name.slice(name.indexOf("/") + 1)];
  const believed = run.beliefs.find((entry) => entry.name === algorithm)?.at(user, us);
  const rooms = run.facts.home.rooms.length;
  const lane = run.roomsOf(user);
  const time = timeByValue(lane, rooms, us);
  const atHome = time.subarray(0, rooms).reduce((sum, part) => sum + part, 0);
  const total = atHome + time[rooms]!;
  // Rooms that sum up to one beside a share of being away are shares of the time at home.
  const inRooms = believed?.shares.subarray(0, rooms).reduce((sum, part) => sum + part, 0) ?? 1;
  const roomTotal = inRooms > 0.98 ? atHome : total;
  const truth = time.map((part, i) => {
    const of = i < rooms ? roomTotal : total;
    return of > 0 ? part / of : 0;
  });
  const now = valueAt(lane, us);
  return {
    user,
    algorithm,
    believed: believed?.shares ?? new Float64Array(rooms + 1),
    truth,
    now: now === null ? -1 : now === AWAY ? rooms : now,
    sinceUs: believed?.us ?? -1,
  };
}

export function drawBeliefs(context: CanvasRenderingContext2D, run: Run, frame: Frame, us: number): void {
  const comparison = comparisonAt(run, us);
  if (!comparison) return;
  const color = bodyColor(run.body(comparison.user)?.color ?? "#0077bb");
  run.facts.home.rooms.forEach((room, i) => {
    const [x, y] = [frame.x(room.anchor[0]), frame.y(room.anchor[1])];
    const radius = (share: number): number => Math.sqrt(share) * FULL_M * frame.scale;
    context.beginPath();
    context.arc(x, y, radius(comparison.believed[i]!), 0, 2 * Math.PI);
    context.fillStyle = color;
    context.globalAlpha = 0.45;
    context.fill();
    context.globalAlpha = 1;
    context.beginPath();
    context.arc(x, y, radius(comparison.truth[i]!), 0, 2 * Math.PI);
    context.strokeStyle = colors.value.text;
    context.lineWidth = 1.5;
    context.setLineDash([3, 2]);
    context.stroke();
    context.setLineDash([]);
  });
}
