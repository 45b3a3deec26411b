// Time of the frame that is drawn.
layout(std140) uniform frame_block {
    float time;        // seconds since frame 1
    float delta_time;  // seconds since the frame before
    int frame_index;   // from 1
    int still_frames;  // how many frames before this one nothing has moved: camera, scene or parameters
};
