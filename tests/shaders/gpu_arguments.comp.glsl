// Writes the arguments of an indirect dispatch.
#version 460

layout(local_size_x = 1) in;
layout(set = 0, binding = 0) buffer arguments_block { uint arguments[]; };

void main()
{
    arguments[0] = 99u;
    arguments[1] = 5u;
    arguments[2] = 3u;
    arguments[3] = 1u;
}
