// Writes its specialization constants.
#version 460

layout(local_size_x = 1) in;
layout(constant_id = 0) const uint WHOLE = 1u;
layout(constant_id = 1) const float REAL = 2.0;
layout(constant_id = 2) const bool FLAG = false;
layout(set = 0, binding = 0) writeonly buffer output_block { float values[]; };

void main()
{
    values[0] = float(WHOLE);
    values[1] = REAL;
    values[2] = FLAG ? 1.0 : 0.0;
}
