// A guided tour: the card of the present step over the scene, and what the user answers to it.
(() => {
  // pixels; a scene of at least ROOMY has the card in its right corner, BUTTON above the edge, where it hides no body
  const WIDE = 440, SLIM = 350, EDGE = 12, BUTTON = 52, ABOVE = 90, NARROW = 560, ROOMY = 760;
  const card = Object.assign(document.createElement("section"), { className: "motorgrad-tour" });
  card.setAttribute("aria-label", "Guided tour");
  card.setAttribute("aria-live", "polite");
  let answers = 0, shown = "";
  const source = () => document.querySelector(".motorgrad-tour-source");
  const answer = value => {
    const uuid = source()?.dataset.go;
    if (uuid) window.motorgrad.send({ type: "GuiUpdateMessage", uuid, updates: { value: `${++answers}:${value}` } });
  };
  const settle = () => {
    const step = source(), canvas = document.querySelector("canvas");
    if (!step || !canvas || document.getElementById("motorgrad-cover")) { card.remove(); shown = ""; return; }
    if (step.dataset.step !== shown) {
      shown = step.dataset.step;
      card.innerHTML = step.innerHTML;
    } else {  // a button that is being pressed stays where it is
      const hint = step.querySelector(".hint").textContent, here = card.querySelector(".hint");
      if (here.textContent !== hint) here.textContent = hint;
    }
    if (!card.isConnected) document.body.append(card);
    const box = canvas.getBoundingClientRect(), aside = box.width >= ROOMY;
    const wide = Math.min(aside ? SLIM : WIDE, box.width - 2 * EDGE);
    const left = aside ? box.width - wide - EDGE : (box.width - wide) / 2;
    const above = box.width < NARROW ? EDGE + 0.02 * window.innerHeight : aside ? BUTTON : ABOVE;  // a sheet covers 2 %
    Object.assign(card.style, { width: `${wide}px`, left: `${box.left + left}px` });
    card.style.bottom = `${window.innerHeight - box.bottom + above}px`;
  };
  card.addEventListener("click", event => {
    const word = event.target.closest("button")?.dataset.word;
    if (word) answer(word);
  });
  window.addEventListener("keydown", event => {
    const word = { PageDown: "next", PageUp: "back", Escape: "end" }[event.key];
    if (!word || !card.isConnected || document.querySelector(".mantine-Modal-content")) return;
    if (event.target.closest?.("input, textarea")) return;
    event.preventDefault();
    answer(word);
  });
  setInterval(settle, 150);
  window.addEventListener("resize", settle);
})();
