// Shared by the techniques that filter the shadow map before it is looked up: the filtered maps carry the views.
uniform sampler2DArray coverage;  // fraction of the filter region that the map covers

#define MAP_HALF_WIDTH 1.0  // the offset need not grow with the filter's width: the filtered moments contain the slope
#define MAP_VIEWS coverage_views
#define MAP_LIGHTS coverage_lights
#define MAP_LAYERS COVERAGE_LAYERS
