/** What one can change in a simulation, offered in one list. */

import { useSignal } from "@preact/signals";
import type { Run } from "../data/run";
import * as state from "../state";
import { calling, order, placing } from "./orders";

interface Offer {
  words: string;
  group: string;
  run: () => void;
}

/** Everything that can be changed in a simulation now. */
function offersOf(run: Run, doors: Readonly<Record<string, boolean>>, change: (name: string, path: string) => void): Offer[] {
  const ofBodies = run.bodies.flatMap(({ name, keys }): Offer[] => {
    const label = run.label(name);
    const paths = Object.entries(keys).flatMap(([behavior, ofBehavior]) => Object.keys(ofBehavior).map((key) => `${behavior}.${key}`));
    return [
      { group: label, words: `Put ${label} somewhere …`, run: () => (placing.value = name) },
      { group: label, words: `Call ${label} somewhere …`, run: () => (calling.value = name) },
      { group: label, words: `${label} decides anew`, run: () => void order({ action: "replan", target: name }) },
      ...paths.map((path) => ({ group: label, words: `${label}: ${path.replaceAll("_", " ")} …`, run: () => change(name, path) })),
    ];
  });
  const ofDoors = Object.entries(doors).map(([name, open]) => ({
    group: "Doors",
    words: `${open ? "Shut" : "Open"} ${name.replaceAll("_", " ")}`,
    run: () => void order({ action: "door", target: name, value: open ? 0 : 1 }),
  }));
  return [...ofBodies, ...ofDoors];
}

export function Offers({ run, doors }: { run: Run; doors: Readonly<Record<string, boolean>> }) {
  const key = useSignal<{ name: string; path: string } | null>(null);
  const change = (name: string, path: string): void => {
    state.select(name, run);
    key.value = { name, path };
    requestAnimationFrame(() => document.getElementById("new-value")?.focus());
  };
  const offers = offersOf(run, doors, change);
  const groups = [...new Set(offers.map(({ group }) => group))];
  return (
    <span class="group">
      <select aria-label="What to change" value="" onChange={(event) => offers[Number(event.currentTarget.value)]?.run()}>
        <option value="">What if …</option>
        {groups.map((group) => (
          <optgroup key={group} label={group}>
            {offers.map(({ words, group: own }, i) =>
              own === group ? (
                <option key={words} value={String(i)}>
                  {words}
                </option>
              ) : null,
            )}
          </optgroup>
        ))}
      </select>
      {key.value && <NewValue key={key.value.path} run={run} {...key.value} close={() => (key.value = null)} />}
    </span>
  );
}

/** The value of a key of a behavior, which starts anew with it. */
function NewValue({ run, name, path, close }: { run: Run; name: string; path: string; close: () => void }) {
  const [behavior = "", key = ""] = path.split(".");
  const present = run.body(name)?.keys[behavior]?.[key];
  const value = useSignal(typeof present === "string" ? present : JSON.stringify(present ?? null));
  const put = (): void => {
    void order({ action: "configure", target: name, key: path, text: value.value });
    close();
  };
  return (
    <span class="group">
      <input
        id="new-value"
        aria-label={`Value of ${path}`}
        size={10}
        value={value.value}
        onInput={(event) => (value.value = event.currentTarget.value)}
        onKeyDown={(event) => {
          if (event.key === "Enter") put();
        }}
      />
      <button type="button" onClick={put}>
        Change
      </button>
    </span>
  );
}
