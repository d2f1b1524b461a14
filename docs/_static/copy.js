// A button that copies the code of a block: of doctests what was typed, without prompts and answers.
const typed = (text) => {
  const lines = text.split("\n");
  if (!lines.some((line) => line.startsWith(">>> "))) return text;
  return lines
    .filter((line) => /^(>>>|\.\.\.)( |$)/.test(line))
    .map((line) => line.slice(4))
    .join("\n");
};

document.addEventListener("DOMContentLoaded", () => {
  if (!navigator.clipboard) return; // as in pages that are not served safely
  for (const block of document.querySelectorAll(".bd-article div.highlight")) {
    if (block.closest(".cell_output, .sphx-glr-script-out")) continue;
    const button = document.createElement("button");
    button.type = "button";
    button.className = "copies";
    button.textContent = "Copy";
    button.addEventListener("click", async () => {
      await navigator.clipboard.writeText(typed(block.querySelector("pre").textContent).trimEnd());
      button.textContent = "Copied";
      setTimeout(() => (button.textContent = "Copy"), 1500);
    });
    block.append(button);
  }
});
