/** What an algorithm believes, on the plan: a disc in each room, beside a ring for what is true. */

import type { Beliefs } from "../data/beliefs";
import type { Series } from "../data/metrics";
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
  /** Whether it is about where the user is now: then the truth is that room. */
  isOfNow: boolean;
  /** Share per room as believed, and as it was up to now or is now; the last is away. */
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

/** The algorithm and the user whose beliefs are shown; null where there are none. */
export function chosenBelief(run: Run): { beliefs: Beliefs; user: string } | null {
  const names = beliefNames(run);
  const name = names.includes(belief.value) ? belief.value : names[0];
  const cut = name?.indexOf("/") ?? 0;
  const beliefs = run.beliefs.find((entry) => entry.name === name?.slice(0, cut));
  return name && beliefs ? { beliefs, user: name.slice(cut + 1) } : null;
}

export function comparisonAt(run: Run, us: number): Comparison | null {
  const chosen = chosenBelief(run);
  if (!chosen) return null;
  const { beliefs, user } = chosen;
  const believed = beliefs.at(user, us);
  const rooms = run.facts.home.rooms.length;
  const found = valueAt(run.roomsOf(user), us);
  const now = found === null ? -1 : found === AWAY ? rooms : found;
  return {
    user,
    algorithm: beliefs.name,
    isOfNow: beliefs.isOfNow,
    believed: believed?.shares ?? new Float64Array(rooms + 1),
    truth: beliefs.isOfNow ? certain(now, rooms) : sharesOf(timeByValue(run.roomsOf(user), rooms, us), believed?.shares ?? null),
    now,
    sinceUs: believed?.us ?? -1,
  };
}

/** A share of 1 in one room, of the rooms and away. */
function certain(room: number, rooms: number): Float64Array {
  const shares = new Float64Array(rooms + 1);
  if (room >= 0) shares[room] = 1;
  return shares;
}

/** Shares of some time by room, given in the way of some believed shares. */
function sharesOf(time: Float64Array, believed: Float64Array | null): Float64Array {
  const rooms = time.length - 1;
  const sum = (part: Float64Array): number => part.subarray(0, rooms).reduce((total, value) => total + value, 0);
  const atHome = sum(time);
  const total = atHome + time[rooms]!;
  // Rooms that sum up to one beside a share of being away are shares of the time at home.
  const roomTotal = (believed ? sum(believed) : 1) > 0.98 ? atHome : total;
  return time.map((part, i) => {
    const of = i < rooms ? roomTotal : total;
    return of > 0 ? part / of : 0;
  });
}

/**
 * How wrong each output about a user was: of where they are now, the probability of all wrong rooms; of
 * shares, half the sum of the differences between the rooms (total variation).
 */
export function errorsOf(run: Run, { beliefs, user }: { beliefs: Beliefs; user: string }): Series {
  const { us, shares } = beliefs.of(user)!;
  const { from, to, value } = run.roomsOf(user);
  const rooms = run.facts.home.rooms.length;
  const time = new Float64Array(rooms + 1);
  let i = 0; // the stretch that the output is in, or the first one after it
  const values = us.map((at, k) => {
    for (; i < to.length && to[i]! <= at; i++) time[value[i] === AWAY ? rooms : value[i]!]! += to[i]! - from[i]!;
    const isInside = i < from.length && from[i]! <= at;
    const room = isInside ? (value[i] === AWAY ? rooms : value[i]!) : -1;
    if (beliefs.isOfNow) return room < 0 ? NaN : 1 - shares[k]![room]!;
    const until = time.slice();
    if (isInside) until[room]! += at - from[i]!;
    const truth = sharesOf(until, shares[k]!);
    return shares[k]!.subarray(0, rooms).reduce((sum, share, j) => sum + Math.abs(share - truth[j]!), 0) / 2;
  });
  return { name: "error", us, values };
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
