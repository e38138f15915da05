/** A question about the run: its answers are marks on a lane, which ‹ and › step through. */

import { useSignal } from "@preact/signals";
import { completions, EXAMPLES } from "../data/ask";
import * as state from "../state";

export function Ask() {
  const text = useSignal("");
  const run = state.run.value!;
  void run.version.value;
  const answer = state.answer.value;
  // Read by tests and by nobody else: the first stretches in steps.
  const steps = answer?.spans.slice(0, 1000).map(({ from, to }) => `${from / run.clock.stepUs}-${to / run.clock.stepUs}`);
  const put = (question: string): void => {
    state.question.value = question.trim() ? { text: question, nearUs: state.moment.value } : null;
    const first = state.answer.value?.spans[0];
    if (first) state.goTo(first.from);
  };
  return (
    <div class="ask">
      <input
        id="ask"
        type="search"
        list="ask-words"
        aria-label="Ask the timeline"
        aria-describedby="ask-answer"
        placeholder={`Ask: ${EXAMPLES[0]}`}
        size={28}
        value={text.value}
        onInput={(event) => {
          text.value = event.currentTarget.value;
          if (!text.value) put("");
        }}
        onKeyDown={(event) => {
          if (event.key === "Enter") put(text.value);
        }}
      />
      <datalist id="ask-words">
        {completions(run, text.value, state.runs.value.length > 1).map((words) => (
          <option key={words} value={words} />
        ))}
      </datalist>
      <output id="ask-answer" data-question={answer?.question} data-spans={steps?.join(" ")} data-count={answer?.spans.length ?? 0}>
        {answer?.words ?? ""}
      </output>
    </div>
  );
}
