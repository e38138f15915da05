/** What algorithms believe: shares per room, as in their outputs. */

import type { Home } from "./home";
import type { Table } from "./parquet";
import { firstAtLeast, lastAtMost } from "./search";

/** Columns of tables with the share of time, or the probability, of a user in a room. */
const SHARE_COLUMNS = ["share", "probability", "p"];

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

/** Read the outputs of an algorithm; null where they are no shares per room. */
export async function readBeliefs(
  name: string,
  table: Table,
  home: Home,
  stepUs: number,
  isOfNow: boolean,
): Promise<Beliefs | null> {
  const column = SHARE_COLUMNS.find((name) => table.has(name));
  if (!column || !table.has("room")) return null;
  const steps = await table.numbers("step");
  const shares = await table.numbers(column);
  const room = await table.words("room");
  const user = table.has("user") ? await table.words("user") : null;
  const index = room.words.map((word) => {
    const room = home.roomIndex(word);
    return room >= 0 ? room : home.facts.rooms.length;
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
      ofUser.shares.push(new Float64Array(home.facts.rooms.length + 1));
    }
    const place = room.codes[i]! >= 0 ? index[room.codes[i]!]! : home.facts.rooms.length;
    ofUser.shares[ofUser.shares.length - 1]![place]! += shares[i]!;
  }
  return new Beliefs(name, series, isOfNow);
}
