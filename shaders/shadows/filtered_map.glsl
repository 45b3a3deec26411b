// What the techniques share that filter a map before anybody looks it up: where they find its views.
uniform sampler2DArray covered;  // share of the filter where something is

#define MAP_HALF_WIDTH 1.0  // the filter's width needs no offset: what is kept of a slope says how it is spread
#define MAP_VIEWS covered_views
#define MAP_LIGHTS covered_lights
#define MAP_LAYERS COVERED_LAYERS
