/** What an algorithm believes of each room, as bars beside what is true. */

import { percents } from "../data/beliefs";
import type { Run } from "../data/run";
import { beliefNames, comparisonAt } from "../plan/beliefs";
import * as state from "../state";
import { bodyColor } from "../theme";

export function BeliefsPanel() {
  return (
    <>
      {state.runs.value.map((run, i) => (
        <BeliefsOf key={i} run={run} title={state.runs.value.length > 1 ? run.facts.title : ""} />
      ))}
    </>
  );
}

function beliefText(run: Run, name: string): string {
  const [algorithm, user] = name.split("/") as [string, string];
  return `${algorithm.replaceAll("_", " ")} of ${run.label(user)}`;
}

function BeliefsOf({ run, title }: { run: Run; title: string }) {
  void run.version.value;
  const names = beliefNames(run);
  const comparison = comparisonAt(run, state.told.value);
  if (!comparison) return <p class="hint">No algorithm of this run puts out shares per room that sum to 1.</p>;
  const color = bodyColor(run.body(comparison.user)?.color ?? "#0077bb");
  const { believed, truth } = comparison;
  const [believedPercents, truePercents] = [believed && percents(believed), truth && percents(truth)];
  const labels = [...run.home.labels, "Out of home"];
  const rows = [...run.facts.home.rooms.map((room) => room.name), "away"]
    .map((name, i) => ({ name, label: labels[i], isNow: comparison.now.has(i), believed: believed?.[i] ?? 0, truth: truth?.[i] ?? 0, percents: [believedPercents?.[i], truePercents?.[i]] }))
    .filter((row) => row.isNow || row.percents.some((percent) => percent));
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
              {beliefText(run, name)}
            </option>
          ))}
        </select>
      </label>
      <p class="hint">
        {comparison.asOfUs < 0 ? "No output yet." : `Bars: believed, as of ${run.clock.text(comparison.asOfUs)}.`}{" "}
        {comparison.isOfNow ? "Line and ●: the room now." : `Lines: share of the time from ${run.clock.text(run.beginUs)} until now. ● is there now.`}
      </p>
      <table class="bars">
        <tbody>
          {rows.map((row) => (
            <tr key={row.name} data-room={row.name} data-believed={row.believed} data-truth={row.truth}>
              <th scope="row">
                {row.isNow ? <span aria-label="is here now">● </span> : ""}
                {row.label}
              </th>
              <td class="bar">
                <span class="believed" style={{ width: `${100 * row.believed}%`, background: color }} />
                <span class="truth" style={{ left: `${100 * row.truth}%` }} />
              </td>
              {row.percents.map((percent, i) => (
                <td key={i} class="number">
                  {percent === undefined ? "–" : `${percent} %`}
                </td>
              ))}
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
