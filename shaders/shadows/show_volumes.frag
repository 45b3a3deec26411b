// A constant translucent colour.
uniform vec4 face_color;  // display-referred RGB, opacity
out vec4 color;

void main() {
    color = face_color;
}
