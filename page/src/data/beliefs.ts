/** What algorithms believe: the probability of each room and of away, which sum to one. */

import type { Home } from "./home";
import type { Table } from "./parquet";
import { firstAtLeast, lastAtMost } from "./search";

/** Columns of tables with the share of time, or the probability, of a user in a room. */
const SHARE_COLUMNS = ["share", "probability", "p"];
const SUM_ERROR = 1e-4;

export interface Belief {
  us: number;
  /** By room, in the order of the home; the last is away. */
  shares: Float64Array;
}

/** The outputs about one user: their moments, and shares by room, the last is away. */
export interface BeliefSeries {
  us: number[];
  shares: Float64Array[];
}

export class Beliefs {
  constructor(
    readonly name: string,
    private readonly series: Map<string, BeliefSeries>,
    /** Whether they are of where a user is now, and not of shares of time. */
    readonly isOfNow = false,
  ) {}

  /** A copy of the outputs before a moment, which can grow. */
  until(us: number): Beliefs {
    const series = [...this.series].map(([user, { us: moments, shares }]) => {
      const count = firstAtLeast(moments, us);
      return [user, { us: moments.slice(0, count), shares: shares.slice(0, count) }] as const;
    });
    return new Beliefs(this.name, new Map(series), this.isOfNow);
  }

  /** Add an output about a user, unless it is the last one. */
  add(user: string, us: number, shares: Float64Array): void {
    const { us: moments, shares: all } = this.series.get(user) ?? { us: [], shares: [] };
    if (all.at(-1)?.every((share, i) => share === shares[i])) return;
    moments.push(us);
    all.push(shares);
    this.series.set(user, { us: moments, shares: all });
  }

  of(user: string): BeliefSeries | null {
    return this.series.get(user) ?? null;
  }

  get users(): string[] {
    return [...this.series.keys()];
  }

  /** What was believed of a user at a moment; null before the first output. */
  at(user: string, us: number): Belief | null {
    const ofUser = this.series.get(user);
    if (!ofUser) return null;
    const i = lastAtMost(ofUser.us, us);
    return i < 0 ? null : { us: ofUser.us[i]!, shares: ofUser.shares[i]! };
  }

  /** Moments of all outputs, in order. */
  get moments(): number[] {
    return this.series.values().next().value?.us ?? [];
  }
}

/**
 * Read the outputs of an algorithm; null where they are no shares per room that sum to one.
 *
 * A table without a column `user` is about each of the users. One with a column `at` has the steps that its rows
 * are about there, as they may be stored later.
 */
export async function readBeliefs(
  name: string,
  table: Table,
  home: Home,
  users: readonly string[],
  stepUs: number,
  isOfNow: boolean,
): Promise<Beliefs | null> {
  const column = SHARE_COLUMNS.find((name) => table.has(name));
  if (!column || !table.has("room")) return null;
  const steps = await table.numbers(table.has("at") ? "at" : "step");
  const shares = await table.numbers(column);
  const room = await table.words("room");
  const user = table.has("user") ? await table.words("user") : null;
  const away = home.facts.rooms.length;
  const index = room.words.map((word) => {
    const room = home.roomIndex(word);
    return room >= 0 ? room : away;
  });
  const series = new Map<string, BeliefSeries>();
  for (let i = 0; i < steps.length; i++) {
    const key = user ? (user.words[user.codes[i]!] ?? "") : "";
    let ofUser = series.get(key);
    if (!ofUser) {
      ofUser = { us: [], shares: [] };
      series.set(key, ofUser);
    }
    const us = steps[i]! * stepUs;
    if (ofUser.us[ofUser.us.length - 1] !== us) {
      ofUser.us.push(us);
      ofUser.shares.push(new Float64Array(away + 1));
    }
    const place = room.codes[i]! >= 0 ? index[room.codes[i]!]! : away;
    ofUser.shares[ofUser.shares.length - 1]![place]! += shares[i]!;
  }
  const all = [...series.values()].flatMap((ofUser) => ofUser.shares);
  if (!all.every(makeDistribution)) return null;
  const common = series.get("");
  return new Beliefs(name, user || !common ? series : new Map(users.map((each) => [each, common])), isOfNow);
}

/**
 * Let shares of rooms and of away sum to one: those of rooms may be given at home, as those of presence are.
 * False where they sum to something else.
 */
export function makeDistribution(shares: Float64Array): boolean {
  const rooms = shares.subarray(0, -1);
  const away = shares[rooms.length]!;
  const sum = rooms.reduce((total, share) => total + share, 0);
  if (Math.abs(sum - 1) <= SUM_ERROR) {
    rooms.forEach((share, i) => (rooms[i] = share * (1 - away)));
    return away >= 0 && away <= 1;
  }
  return Math.abs(sum + away - 1) <= SUM_ERROR;
}

/** Shares in whole percents that sum to 100: those that lose most by being rounded down are rounded up. */
export function percents(shares: Float64Array): number[] {
  const exact = [...shares].map((share) => 100 * share);
  const rounded = exact.map(Math.floor);
  const total = Math.round(exact.reduce((sum, value) => sum + value, 0));
  const missing = total - rounded.reduce((sum, value) => sum + value, 0);
  const byRest = [...exact.keys()].sort((a, b) => exact[b]! - rounded[b]! - (exact[a]! - rounded[a]!));
  for (const i of byRest.slice(0, missing)) rounded[i]!++;
  return rounded;
}
