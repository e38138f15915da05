/** Pairs of a term and what it is. */

import type { ComponentChildren } from "preact";

export function Terms({ rows }: { rows: readonly (readonly [ComponentChildren, ComponentChildren])[] }) {
  return (
    <dl>
      {rows.map(([term, words], i) => (
        <div key={i}>
          <dt>{term}</dt>
          <dd>{words}</dd>
        </div>
      ))}
    </dl>
  );
}
