/** When people sit or lie, and where, as Python made it of a stored run. */

import type { PostureFacts, UseFacts } from "../contract";
import { lastAtMost } from "./search";

interface OfUser {
  from: number[];
  to: number[];
  use: number[];
}

export class Postures {
  private readonly byUser = new Map<string, OfUser>();

  constructor(private readonly facts: PostureFacts) {
    facts.user.forEach((user, i) => {
      let rows = this.byUser.get(user);
      if (!rows) this.byUser.set(user, (rows = { from: [], to: [], use: [] }));
      rows.from.push(facts.from_us[i]!);
      rows.to.push(facts.to_us[i]!);
      rows.use.push(facts.use[i]!);
    });
  }

  /** The place on which somebody sits or lies at a moment; null: they don't. */
  at(user: string, us: number): UseFacts | null {
    const rows = this.byUser.get(user);
    const i = rows ? lastAtMost(rows.from, us) : -1;
    return rows && i >= 0 && us < rows.to[i]! ? this.facts.uses[rows.use[i]!]! : null;
  }
}
