/** What the page asks of a running simulation. */

import { signal } from "@preact/signals";
import type { LiveOrder, Problem } from "../contract";

/** The body that the next click on the plan puts somewhere; empty: none. */
export const placing = signal("");
/** The body that goes where the next click on the plan is; empty: none. */
export const calling = signal("");
/** Why the last order was refused; empty if it was not. */
export const refusal = signal("");

export async function order(wish: Partial<LiveOrder> & Pick<LiveOrder, "action">): Promise<void> {
  const complete: LiveOrder = { target: "", value: 0, x: 0, y: 0, ...wish };
  const response = await fetch("live/order", {
    method: "POST",
    headers: { "Content-Type": "application/json" },
    body: JSON.stringify(complete),
  });
  const problem = response.ok ? null : ((await response.json().catch(() => null)) as Problem | null);
  refusal.value = response.ok ? "" : (problem?.message ?? `refused: ${response.status}`);
}

export async function askPlace(name: string, x: number, y: number): Promise<void> {
  placing.value = "";
  await order({ action: "place", target: name, x, y });
}

export async function askCall(name: string, x: number, y: number): Promise<void> {
  calling.value = "";
  await order({ action: "call", target: name, x, y });
}
