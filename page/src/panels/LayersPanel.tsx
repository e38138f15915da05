/** What the plan shows: switches, and the run's layers of cells. */

import * as state from "../state";
import { scaleColor } from "../theme";

const WORDS: Record<state.Switch, string> = {
  names: "names",
  furniture: "furniture",
  ways: "ways behind and ahead",
  sight: "what is in view",
  observations: "observations",
  beliefs: "beliefs",
};

export function LayersPanel() {
  const run = state.run.value!;
  const layers = run.facts.tables.filter((table) => table.role === "layer").map((table) => table.name.slice("layer.".length));
  return (
    <div>
      <fieldset>
        <legend>On the plan</legend>
        {state.SWITCHES.map((name) => (
          <label key={name}>
            <input type="checkbox" name={name} checked={state.shown.value.has(name)} onChange={() => state.toggle(name)} />
            {WORDS[name]}
          </label>
        ))}
      </fieldset>
      <fieldset>
        <legend>Layer of cells</legend>
        {["", ...layers].map((name) => (
          <label key={name}>
            <input
              type="radio"
              name="layer"
              checked={state.layer.value === name}
              onChange={() => {
                state.layer.value = name;
              }}
            />
            {name || "none"}
          </label>
        ))}
        {layers.length === 0 && <p class="hint">The run stored none; a scenario asks for them under floorplan.layers.</p>}
        {state.layer.value && <ScaleBar />}
      </fieldset>
    </div>
  );
}

function ScaleBar() {
  const stops = [0, 0.2, 0.4, 0.6, 0.8, 1].map((share) => `rgb(${scaleColor(share).join()})`);
  return (
    <p class="scale">
      low <span style={{ background: `linear-gradient(90deg, ${stops.join()})` }} /> high
    </p>
  );
}
