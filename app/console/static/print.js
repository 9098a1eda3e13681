// The button that prints; without this script there is none, and the browser's menu prints.
"use strict";
(() => {
  const button = document.getElementById("print");
  button.hidden = false;
  button.addEventListener("click", () => print());
})();
