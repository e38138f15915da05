/** What is on the plan but of another moment than the one that is shown. */

import type { Run } from "../data/run";
import * as state from "../state";
import { comparisonAt } from "./beliefs";

/** The layer and the beliefs, which runs store now and then, each with its own moment. */
export function olderWords(run: Run, at: number): string {
  const { layerUs } = run;
  const belief = state.shown.value.has("beliefs") ? comparisonAt(run, at) : null;
  const shown: [string, number][] = [];
  if (state.layer.value && layerUs.value !== null) shown.push([state.layer.value, layerUs.value]);
  if (belief && belief.asOfUs >= 0) shown.push([`${belief.algorithm} of ${belief.user}`, belief.asOfUs]);
  const others = shown.filter(([, us]) => us !== at);
  return others.map(([name, us]) => `${name.replaceAll("_", " ")} as of ${run.clock.text(us)}${us > at ? ", which is later" : ""}`).join(" · ");
}
