/** Controls of a running simulation: pause, slow, step, go on, intervene. */

import { useSignal } from "@preact/signals";
import * as state from "../state";
import { connected, feeds, status } from "./feed";
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
        <Configure key={name} name={name} keys={run.body(name)!.keys} />
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

/** Change a key of a behavior: it starts anew with it. */
function Configure({ name, keys }: { name: string; keys: Record<string, Record<string, unknown>> }) {
  const chosen = useSignal("");
  const value = useSignal("");
  const names = Object.entries(keys).flatMap(([behavior, ofBehavior]) => Object.keys(ofBehavior).map((key) => `${behavior}.${key}`));
  const present = (path: string): string => {
    const [behavior = "", key = ""] = path.split(".");
    const found = keys[behavior]?.[key];
    return typeof found === "string" ? found : JSON.stringify(found ?? null);
  };
  return (
    <span class="group">
      <select
        aria-label={`Key of a behavior of ${name}`}
        value={chosen.value}
        onChange={(event) => {
          chosen.value = event.currentTarget.value;
          value.value = chosen.value ? present(chosen.value) : "";
        }}
      >
        <option value="">Change …</option>
        {names.map((path) => (
          <option key={path} value={path}>
            {path}
          </option>
        ))}
      </select>
      {chosen.value && (
        <>
          <input
            aria-label={`Value of ${chosen.value}`}
            size={10}
            value={value.value}
            onInput={(event) => {
              value.value = event.currentTarget.value;
            }}
          />
          <button type="button" onClick={() => void order({ action: "configure", target: name, key: chosen.value, text: value.value })}>
            Change
          </button>
        </>
      )}
    </span>
  );
}
