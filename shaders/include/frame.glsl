// Time and number of the current frame.
layout(std140) uniform frame_block {
    float time;        // seconds since frame 1
    float delta_time;  // seconds since the previous frame
    int frame_index;   // from 1
    int still_frames;  // number of previous frames in which nothing has moved or changed
};
