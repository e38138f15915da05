/** What the plan shows: switches, and the run's layers of cells. */

import { SWITCH_WORDS } from "../actions";
import * as state from "../state";
import { roomColor, scaleColor } from "../theme";
import { olderWords } from "../plan/older";
import { Terms } from "./Terms";

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
            {SWITCH_WORDS[name]}
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
        {state.layer.value && <p class="hint">{olderWords(run, state.told.value)}</p>}
        {state.layer.value && <ScaleBar />}
      </fieldset>
      <Legend />
    </div>
  );
}

const LEGEND: [string, string][] = [
  ["●", "somebody; the point says where they face"],
  ["■", "a robot"],
  ["──", "its way of the last five minutes"],
  ["┄┄", "its way of the next two minutes"],
  ["◔", "what a camera has in view: teal; further cameras blue, orange"],
  ["◯", "somebody whom a robot notices"],
  ["⊗", "a false observation, red"],
  ["◌", "where somebody is in the other run, red"],
  ["▒", "a room whose light is off"],
  ["≈", "a floor on which robots are slow, blue"],
  ["┅", "an area that robots keep out of"],
  ["▨", "where the robot that is selected keeps out"],
];

function Legend() {
  const run = state.run.value!;
  const kinds = new Map(run.facts.home.rooms.map((room) => [room.type, roomColor(room.color, room.deep_color)]).reverse() as [string, string][]);
  const signs = LEGEND.map(([sign, words]) => [<span aria-hidden="true">{sign}</span>, words] as const);
  const chips = [...kinds].reverse().map(([kind, color]) => [<span class="chip robot" style={{ background: color }} />, kind.replaceAll("_", " ")] as const);
  return (
    <fieldset class="legend">
      <legend>Legend</legend>
      <Terms rows={[...signs, ...chips]} />
      <p class="hint">Rooms of one type differ in shade.</p>
    </fieldset>
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
