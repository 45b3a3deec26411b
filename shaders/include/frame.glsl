// Time of the frame that is drawn.
layout(std140) uniform frame_block {
    float time;        // seconds since frame 1
    float delta_time;  // seconds since the frame before
    int frame_index;   // from 1
    int frame_pad;
};
