/** What an algorithm believes of each room, as bars beside what is true. */

import type { Run } from "../data/run";
import { beliefNames, comparisonAt } from "../plan/beliefs";
import * as state from "../state";
import { bodyColor } from "../theme";
import { slowMoment } from "./slow";

export function BeliefsPanel() {
  return (
    <>
      {state.runs.value.map((run, i) => (
        <BeliefsOf key={i} run={run} title={state.runs.value.length > 1 ? run.facts.title : ""} />
      ))}
    </>
  );
}

function BeliefsOf({ run, title }: { run: Run; title: string }) {
  void run.version.value;
  const names = beliefNames(run);
  const comparison = comparisonAt(run, slowMoment.value);
  if (!comparison) return <p class="hint">No algorithm of this run puts out shares per room.</p>;
  const color = bodyColor(run.body(comparison.user)?.color ?? "#0077bb");
  const rows = [...run.facts.home.rooms.map((room) => room.name), "away"]
    .map((name, i) => ({ name, i, believed: comparison.believed[i]!, truth: comparison.truth[i]! }))
    .filter((row) => row.believed > 0.002 || row.truth > 0.002 || row.i === comparison.now);
  return (
    <div>
      {title && <h2>{title}</h2>}
      <label>
        Of{" "}
        <select
          value={`${comparison.algorithm}/${comparison.user}`}
          onChange={(event) => {
            state.belief.value = event.currentTarget.value;
          }}
        >
          {names.map((name) => (
            <option key={name} value={name}>
              {name.replace("/", " of ")}
            </option>
          ))}
        </select>
      </label>
      <p class="hint">
        {comparison.sinceUs < 0
          ? "No output yet."
          : `Bars: believed since ${run.clock.text(comparison.sinceUs)}. ${
              comparison.isOfNow ? "Line and ●: the room now." : "Lines: share of the time until now, of rooms at home. ● is there now."
            }`}
      </p>
      <table class="bars">
        <tbody>
          {rows.map((row) => (
            <tr key={row.name} data-room={row.name} data-believed={row.believed} data-truth={row.truth}>
              <th scope="row">
                {row.i === comparison.now ? <span aria-label="is here now">● </span> : ""}
                {row.name.replaceAll("_", " ")}
              </th>
              <td class="bar">
                <span class="believed" style={{ width: `${100 * row.believed}%`, background: color }} />
                <span class="truth" style={{ left: `${100 * row.truth}%` }} />
              </td>
              <td class="number">{(100 * row.believed).toFixed(0)} %</td>
              <td class="number">{(100 * row.truth).toFixed(0)} %</td>
            </tr>
          ))}
        </tbody>
        <thead>
          <tr>
            <th scope="col">Room</th>
            <th scope="col">
              <span class="visually-hidden">Bars</span>
            </th>
            <th scope="col">believed</th>
            <th scope="col">true</th>
          </tr>
        </thead>
      </table>
    </div>
  );
}
