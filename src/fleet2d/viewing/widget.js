// Show the page in a frame that can reach nothing of the notebook around it.
function render({ model, el }) {
  const frame = document.createElement("iframe");
  frame.sandbox = "allow-scripts";
  frame.title = "Fleet2D run";
  frame.style.width = "100%";
  frame.style.border = "0";
  const update = () => {
    frame.style.height = `${model.get("height")}px`;
    frame.srcdoc = model.get("content");
  };
  model.on("change:content change:height", update);
  update();
  el.appendChild(frame);
}

export default { render };
