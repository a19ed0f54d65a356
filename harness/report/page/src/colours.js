// Colours that a colour-blind reader tells apart (Okabe and Ito), on light and on dark ground.
export const LINES = {
  light: ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#7a5c00", "#555555"],
  dark: ["#56B4E9", "#E69F00", "#00c08b", "#CC79A7", "#ff7a2e", "#F0E442", "#4aa3df", "#bbbbbb"],
};
// Colours of faults: the first ones differ from the colour of what went wrong, and from lines in the figure of the error.
export const FAULTS = {
  light: ["#E69F00", "#CC79A7", "#56B4E9", "#009E73", "#7a5c00", "#0072B2"],
  dark: ["#F0E442", "#CC79A7", "#bbbbbb", "#00c08b", "#E69F00", "#56B4E9"],
};
