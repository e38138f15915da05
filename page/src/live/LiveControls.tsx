/** Controls of a running simulation: pause, slow, step, go on, intervene. */

import * as state from "../state";
import { connected, feeds, status } from "./feed";
import { Offers } from "./Offers";
import { calling, order, orderAll, placing } from "./orders";

const SPEEDS: [number, string][] = [
  [0, "as fast as it goes"],
  [1, "1 ×"],
  [10, "10 ×"],
  [60, "60 ×"],
  [600, "600 ×"],
  [3600, "1 h a second"],
  [86_400, "a day a second"],
];

export function LiveControls() {
  const now = status.value;
  if (!now) return <span>waiting for the simulation …</span>;
  return (
    <span class="group live" data-step={now.step} data-paused={now.paused} data-done={now.done}>
      <button type="button" class="play" disabled={now.done} onClick={() => void orderAll({ action: now.paused ? "resume" : "pause" })}>
        {now.done ? "Over" : now.paused ? "▶ Run" : "❚❚ Pause"}
      </button>
      <button type="button" disabled={now.done} onClick={() => void orderAll({ action: "step", value: 1 })}>
        Step
      </button>
      <button type="button" disabled={now.done} onClick={() => void orderAll({ action: "step", value: 60 })}>
        +60
      </button>
      <select
        aria-label="Speed of the simulation"
        value={String(now.speed)}
        onChange={(event) => void orderAll({ action: "speed", value: Number(event.currentTarget.value) })}
      >
        {SPEEDS.map(([value, words]) => (
          <option key={value} value={String(value)}>
            {words}
          </option>
        ))}
      </select>
      <label class="group">
        <input
          type="checkbox"
          checked={state.follow.value}
          onChange={() => {
            state.follow.value = !state.follow.value;
            if (state.follow.value) state.goTo(now.step * state.run.value!.clock.stepUs);
          }}
        />
        follow
      </label>
      <Interventions />
      <Offers run={feeds.value[feeds.value.length - 1]!.run} doors={now.doors} />
      <output class="pace" aria-label="Pace">
        {connected.value ? (now.paused || now.done ? "" : `${Math.round(now.achieved).toLocaleString("en")} ×`) : "connection lost"}
      </output>
      {now.message && (
        <strong role="alert" class="status">
          {now.message}
        </strong>
      )}
    </span>
  );
}

/** What can be done to what is selected, in the simulation that was begun last. */
function Interventions() {
  const run = feeds.value[feeds.value.length - 1]!.run;
  const name = state.selected.value;
  const now = status.value!;
  if (run.body(name)) {
    return (
      <>
        <button
          type="button"
          aria-pressed={placing.value === name}
          onClick={() => {
            placing.value = placing.value === name ? "" : name;
          }}
        >
          {placing.value === name ? "Click on the plan …" : `Put ${name} …`}
        </button>
        <button
          type="button"
          title="It goes there and stays; from then on it goes only where it is called."
          aria-pressed={calling.value === name}
          onClick={() => {
            calling.value = calling.value === name ? "" : name;
          }}
        >
          {calling.value === name ? "Click where to …" : `Call ${name} …`}
        </button>
        <button type="button" onClick={() => void order({ action: "replan", target: name })}>
          Decide anew
        </button>
      </>
    );
  }
  const open = now.doors[name];
  if (open === undefined) return null;
  return (
    <button type="button" onClick={() => void order({ action: "door", target: name, value: open ? 0 : 1 })}>
      {open ? `Shut ${name}` : `Open ${name}`}
    </button>
  );
}
