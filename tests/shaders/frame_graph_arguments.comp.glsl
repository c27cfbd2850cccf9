// Writes the arguments of an indirect dispatch: as many groups as asked for.
#version 460

layout(local_size_x = 1) in;
layout(set = 0, binding = 0) writeonly buffer arguments_block { uint arguments[3]; };
layout(push_constant) uniform push { uint groups; };

void main() { arguments = uint[3](groups, 1u, 1u); }
