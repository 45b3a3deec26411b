// One colour; what lies over one another adds up by its opacity.
uniform vec4 tinted;  // display-referred RGB, opacity
out vec4 color;

void main() {
    color = tinted;
}
