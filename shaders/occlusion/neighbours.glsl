// What one pixel's samples hide may come to more than the whole sky: 1 in the texture that keeps it stands for this.
const float MOST_KEPT = 4.0;
