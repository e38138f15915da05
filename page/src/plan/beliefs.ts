/** What an algorithm believes, on the plan: a disc in each room, beside a ring for what is true. */

import type { Beliefs } from "../data/beliefs";
import type { Series } from "../data/metrics";
import { firstAtLeast, lastAtMost } from "../data/search";
import type { Run } from "../data/run";
import { valueAt } from "../data/stretches";
import { belief } from "../state";
import { bodyColor, colors } from "../theme";
import type { Frame } from "./frame";

const FULL_M = 0.9;
/** Whoever is in a room, for algorithms: not the name of a user. */
const ANYONE = "anyone";

export interface Comparison {
  user: string;
  algorithm: string;
  /** Whether it is about where the user is now: then the truth is that room. */
  isOfNow: boolean;
  /** Share per room as believed, and as it was up to now or is now; the last is away. Null: unknown. */
  believed: Float64Array | null;
  truth: Float64Array | null;
  /** Where the user is now, of anyone where somebody is: indices of rooms, the number of rooms for away. */
  now: ReadonlySet<number>;
  /** The moment that the belief is of. */
  asOfUs: number;
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
  const places = placesOf(run, user);
  const now = new Set(places.at(us));
  return {
    user,
    algorithm: beliefs.name,
    isOfNow: beliefs.isOfNow,
    believed: believed?.shares ?? null,
    truth: beliefs.isOfNow ? places.sharesAt(us) : places.sharesUntil(us),
    now,
    asOfUs: believed?.us ?? -1,
  };
}

/** Where somebody is over time, or anybody. */
class Places {
  /** In the stretch from `from[i]` on, the indices of rooms with somebody in them, or that of away. */
  private readonly from: number[] = [];
  private readonly places: number[][] = [];
  /** The time in each place before each stretch; the last is that with nobody at home. */
  private readonly time: Float64Array[] = [];

  constructor(
    private readonly run: Run,
    names: readonly string[],
  ) {
    const lanes = names.map((name) => run.roomsOf(name)).filter((lane) => lane.from.length > 0);
    const { beginUs } = run;
    const cuts = [...new Set(lanes.flatMap((lane) => [beginUs, ...lane.from, lane.to[lane.to.length - 1]!]))].sort((a, b) => a - b);
    const time = new Float64Array(this.away + 1);
    for (const cut of cuts.slice(firstAtLeast(cuts, beginUs))) {
      this.add(time, cut);
      const rooms = new Set(lanes.map((lane) => valueAt(lane, cut)).filter((room) => room !== null));
      const inside = [...rooms].filter((room) => room >= 0);
      this.from.push(cut);
      this.places.push(inside.length > 0 || rooms.size === 0 ? inside : [this.away]);
      this.time.push(time.slice());
    }
  }

  private get away(): number {
    return this.run.facts.home.rooms.length;
  }

  /** Add the time from the begin of the last stretch to a moment. */
  private add(time: Float64Array, us: number): void {
    for (const place of this.places.at(-1) ?? []) time[place]! += us - this.from.at(-1)!;
  }

  at(us: number): readonly number[] {
    return this.places[lastAtMost(this.from, us)] ?? [];
  }

  /** The same probability for each place with somebody in it. */
  sharesAt(us: number): Float64Array | null {
    const places = this.at(us);
    if (places.length === 0) return null;
    const shares = new Float64Array(this.away + 1);
    for (const place of places) shares[place] = 1 / places.length;
    return shares;
  }

  /** The shares of the time from the begin up to a moment, as those of presence. */
  sharesUntil(us: number): Float64Array | null {
    const i = lastAtMost(this.from, us);
    if (i < 0) return null;
    const time = this.time[i]!.slice();
    for (const place of this.places[i]!) time[place]! += us - this.from[i]!;
    const rooms = time.subarray(0, this.away).reduce((sum, part) => sum + part, 0);
    const away = time[this.away]! / (us - this.run.beginUs);
    if (!(us > this.run.beginUs)) return null;
    return time.map((part, place) => (place === this.away ? away : rooms > 0 ? (part / rooms) * (1 - away) : 0));
  }
}

const placesOfRuns = new WeakMap<Run, { version: number; places: Map<string, Places> }>();

function placesOf(run: Run, user: string): Places {
  let known = placesOfRuns.get(run);
  if (known?.version !== run.version.value) placesOfRuns.set(run, (known = { version: run.version.value, places: new Map() }));
  let places = known.places.get(user);
  if (!places) {
    const isAnyone = user === ANYONE && !run.body(user);
    const names = isAnyone ? run.bodies.filter((body) => !body.robot).map((body) => body.name) : [user];
    known.places.set(user, (places = new Places(run, names)));
  }
  return places;
}

/**
 * How wrong each output about a user was: half the sum of the differences of all places (total variation), which
 * for beliefs of the present is the probability of all wrong places.
 */
export function errorsOf(run: Run, { beliefs, user }: { beliefs: Beliefs; user: string }): Series {
  const { us, shares } = beliefs.of(user)!;
  const places = placesOf(run, user);
  const values = us.map((at, k) => {
    const truth = beliefs.isOfNow ? places.sharesAt(at) : places.sharesUntil(at);
    return truth ? shares[k]!.reduce((sum, share, i) => sum + Math.abs(share - truth[i]!), 0) / 2 : NaN;
  });
  return { name: "error", us, values };
}

export function drawBeliefs(context: CanvasRenderingContext2D, run: Run, frame: Frame, us: number): void {
  const comparison = comparisonAt(run, us);
  if (!comparison) return;
  const color = bodyColor(run.body(comparison.user)?.color ?? "#0077bb");
  run.facts.home.rooms.forEach((room, i) => {
    const [x, y] = [frame.x(room.anchor[0]), frame.y(room.anchor[1])];
    const radius = (shares: Float64Array | null): number => Math.sqrt(shares?.[i] ?? 0) * FULL_M * frame.scale;
    context.beginPath();
    context.arc(x, y, radius(comparison.believed), 0, 2 * Math.PI);
    context.fillStyle = color;
    context.globalAlpha = 0.45;
    context.fill();
    context.globalAlpha = 1;
    context.beginPath();
    context.arc(x, y, radius(comparison.truth), 0, 2 * Math.PI);
    context.strokeStyle = colors.value.text;
    context.lineWidth = 1.5;
    context.setLineDash([3, 2]);
    context.stroke();
    context.setLineDash([]);
  });
}
